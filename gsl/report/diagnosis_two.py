"""Two diagnoses side by side: which causes they share, and which are of one alone.

What two benches with the same servos share is likely of the servo; what differs is likely of a bench.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from gsl.report.diagnosis_verdict import cause_name
from gsl.report.diagnosis_words import NONE, Document, entries, finite, interval, name, part, value
from gsl.report.tables import Table

ROWS = 50  # at most
SITS = {
    "command": "bus, controller or logger",
    "sensor": "sensor or logger",
    "servo": "servo",
    "body": "body",
    "contact": "ground",
    "environment": "surroundings",
}
"""Where an effect sits, by its kind."""


def set_side_by_side(first: Document, second: Document) -> list[dict[str, Any]]:
    """Return the parameters of the causes of two diagnoses: cause, parameter, where it sits, both, and whether alike.

    Where a verdict names no cause, the suspects stand for it.
    """
    sides = [dict(_list_parameters(document)) for document in (first, second)]
    return [
        {
            "cause": cause,
            "parameter": parameter,
            "sits": sits,
            "first": (left := sides[0].get((cause, parameter, sits))),
            "second": (right := sides[1].get((cause, parameter, sits))),
            "alike": _are_alike(left, right),
        }
        for cause, parameter, sits in dict.fromkeys([*sides[0], *sides[1]])
    ]


def table_of_two(rows: Sequence[Document], verdicts: tuple[str, str], names: tuple[str, str]) -> Table:
    """Return the causes of two diagnoses as a table.

    Args:
        rows: From `set_side_by_side`.
        verdicts: Of both.
        names: Of both.
    """
    shown = [
        (row["cause"], name(row["parameter"]), row["sits"], _show(row["first"]), _show(row["second"]), _judge(row))
        for row in rows[:ROWS]
    ]
    title = ", ".join(f"{verdict} in {run}" for verdict, run in zip(verdicts, names, strict=True))
    more = f"{len(rows) - ROWS} more are not shown. " if len(rows) > ROWS else ""
    note = f"{more}Alike: the 95 % interval of the difference holds 0."
    return Table(f"causes ({title})", ("cause", "parameter", "sits in", *names, ""), shown, note)


def _list_parameters(document: Document) -> Iterator[tuple[tuple[str, str, str], Document]]:
    for cause in entries(document, "causes") or entries(document, "suspects"):
        sits = SITS.get(str(cause.get("kind")), NONE)
        for parameter, fitted in part(cause, "parameters").items():
            yield (cause_name(cause), parameter, sits), fitted


def _are_alike(left: Document | None, right: Document | None) -> bool | None:
    """Return whether two values are, None where one is missing, has no interval, or is in another unit."""
    if left is None or right is None or left.get("unit") != right.get("unit"):
        return None
    read = [finite(side.get(key)) for side in (left, right) for key in ("value", "low", "high")]
    if None in read:
        return None
    a, low, high, b, lower, higher = (number or 0.0 for number in read)
    return abs(a - b) <= math.hypot(0.5 * (high - low), 0.5 * (higher - lower))


def _show(fitted: Document | None) -> str:
    return NONE if fitted is None else f"{value(fitted)} ({interval(fitted)})"


def _judge(row: Document) -> str:
    if row["first"] is None or row["second"] is None:
        return "in one alone"
    return NONE if row["alike"] is None else "alike" if row["alike"] else "differs"
