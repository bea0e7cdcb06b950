"""Two diagnoses side by side: which causes and suspects they share, and which are of one alone.

What two benches with the same servos share is likely of the servo; what differs is likely of a bench.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

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
SIDES, CAUSE, SUSPECT = ("first", "second"), "cause", "suspect"
ELSEWHERE = "Elsewhere: the other one has this effect, too, and in other joints."
SUSPECTS = "Suspect: no cause is named there, and this comes nearest."


class _Key(NamedTuple):
    effect: str
    cause: str
    parameter: str
    sits: str


class _Side(NamedTuple):
    fitted: Document | None
    role: str | None


_ABSENT = _Side(None, None)


def set_side_by_side(first: Document, second: Document) -> list[dict[str, Any]]:
    """Return the parameters of the causes of two diagnoses, those of one effect beside each other.

    Each row has the cause, the parameter and where it sits; of both sides the value and what it stands for; whether the
    values are alike; and whether a side without it has the same effect elsewhere, such as in other joints. A side that
    names no cause has suspects in their place. A cause may be one of several that its log cannot tell apart.
    """
    sides = [dict(_list_parameters(document)) for document in (first, second)]
    effects = [key.effect for key in [*sides[0], *sides[1]]]
    rows = []
    for key in sorted(dict.fromkeys([*sides[0], *sides[1]]), key=lambda key: effects.index(key.effect)):
        left, right = (side.get(key, _ABSENT) for side in sides)
        others = [other for side in sides if key not in side for other in side if other.cause != key.cause]
        rows.append(
            {
                "cause": key.cause,
                "parameter": key.parameter,
                "sits": key.sits,
                "first": left.fitted,
                "second": right.fitted,
                "first_is": left.role,
                "second_is": right.role,
                "alike": _are_alike(left.fitted, right.fitted),
                "elsewhere": any(other.effect == key.effect for other in others),
            }
        )
    return rows


def table_of_two(rows: Sequence[Document], verdicts: tuple[str, str], names: tuple[str, str]) -> Table:
    """Return the causes of two diagnoses as a table.

    Args:
        rows: From `set_side_by_side`.
        verdicts: Of both.
        names: Of both.
    """
    shown = [
        (row["cause"], name(row["parameter"]), row["sits"], *(_show(row, side) for side in SIDES), _judge(row))
        for row in rows[:ROWS]
    ]
    title = ", ".join(f"{verdict} in {run}" for verdict, run in zip(verdicts, names, strict=True))
    more = f"{len(rows) - ROWS} more are not shown. " if len(rows) > ROWS else ""
    notes = [f"{more}Alike: the 95 % interval of the difference holds 0."]
    notes += [ELSEWHERE] * any(row["elsewhere"] for row in rows)
    suspects = any(row[f"{side}_is"] == SUSPECT for row in rows for side in SIDES)
    notes += [SUSPECTS] * suspects
    what, note = "causes and suspects" if suspects else "causes", " ".join(notes)
    return Table(f"{what} ({title})", ("cause", "parameter", "sits in", *names, ""), shown, note)


def _list_parameters(document: Document) -> Iterator[tuple[_Key, _Side]]:
    causes = entries(document, "causes")
    for cause in causes or entries(document, "suspects"):
        sits, effect = SITS.get(str(cause.get("kind")), NONE), str(cause.get("effect"))
        groups = [group for group in entries(document, "inseparable") if effect in group]
        rivals = sorted({rival for group in groups for rival in group} - {effect})
        role = " or ".join([CAUSE, *map(name, rivals)]) if causes else SUSPECT
        for parameter, fitted in part(cause, "parameters").items():
            yield _Key(effect, cause_name(cause), parameter, sits), _Side(fitted, role)


def _are_alike(left: Document | None, right: Document | None) -> bool | None:
    """Return whether two values are, None where one is missing, has no interval, or is in another unit."""
    if left is None or right is None or left.get("unit") != right.get("unit"):
        return None
    read = [finite(side.get(key)) for side in (left, right) for key in ("value", "low", "high")]
    if None in read:
        return None
    a, low, high, b, lower, higher = (number or 0.0 for number in read)
    return abs(a - b) <= math.hypot(0.5 * (high - low), 0.5 * (higher - lower))


def _show(row: Document, side: str) -> str:
    """Return a value with its interval, and what it stands for if that is more than a cause."""
    fitted, role = row[side], row[f"{side}_is"]
    if fitted is None:
        return NONE
    return f"{value(fitted)} ({interval(fitted)})" + (f", {role.removeprefix(f'{CAUSE} ')}" if role != CAUSE else "")


def _judge(row: Document) -> str:
    if row["first"] is None or row["second"] is None:
        return "elsewhere" if row["elsewhere"] else "in one alone"
    return NONE if row["alike"] is None else "alike" if row["alike"] else "differs"
