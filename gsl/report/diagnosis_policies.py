"""The policy-level gap: what policies return in real, in the simulator as it was, and in the diagnosed one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from markupsafe import Markup

from gsl.report.charts import Pair, Span, scatter
from gsl.report.diagnosis_words import NONE, Document, between, entries, finite, part, read_word, short
from gsl.report.parts import bullets, element, prose, section, table

_COLUMNS = {"sim": "simulator", "diagnosed": "", "real": "real"}  # the second is named by the document


def policies(document: Document) -> Markup | None:
    """Return the table, the plot and what is to be said of them."""
    comparison = part(document, "policy_gap")
    rows, unit = entries(comparison, "rows"), read_word(comparison, "unit")
    if not rows:
        return None
    form = _values(comparison)
    titles = [f"{words or _second(comparison)} [{unit}]" for words in _COLUMNS.values()]
    columns = ["policy", *(title for heading in titles for title in (heading, "95 % interval")), "falls"]
    cells = [[read_word(row, "name"), *_cells(row, form), _falls(row)] for row in rows]
    note = (
        "Returns of the same policies in three worlds, counted as on the real side. Both simulators "
        "play the same seeds. A simulator in which policies can be chosen has its dots on the thin line, "
        "or at least in the right order."
    )
    return section(
        "Policies",
        *(element("p", prose(line)) for line in policy_lines(document)),
        table(columns, cells),
        _plot(comparison, rows),
        bullets([str(caveat) for caveat in entries(comparison, "caveats")]),
        note=note,
    )


def policy_lines(document: Document) -> list[str]:
    """Return gap and rank correlation before and after, a sentence each; nothing if no policies were given."""
    comparison = part(document, "policy_gap")
    gap, order, unit = part(comparison, "gap"), part(comparison, "correlation"), read_word(comparison, "unit")
    if not gap:
        return []
    count, form, second = read_word(comparison, "policies"), _values(comparison), _second(comparison)
    before, after = (_format_bounds(part(gap, when), form) for when in ("before", "after"))
    many = "policy" if count == "1" else "policies"
    lines = [f"{count} {many}: returns are {before} {unit} from real in the simulator, {after} in the {second} one."]
    if any(part(order, when) for when in ("before", "after")):
        before, after = (
            _format_bounds(part(order, when), lambda value: short(value, 2)) for when in ("before", "after")
        )
        line = f"Rank correlation with real: {before} in the simulator, {after} in the {second} one."
        low = finite(part(order, "after").get("low"))
        lines.append(line + ("" if low is None or low > 0.0 else " So few policies do not show an order."))
    return lines


def _second(comparison: Document) -> str:
    return str(comparison.get("simulator") or "diagnosed")


def _values(comparison: Document) -> Callable[[Any], str]:
    """Return how returns are told, in the unit of the task."""
    factor = finite(comparison.get("shown")) or 1.0

    def form(value: Any) -> str:
        number = finite(value)
        return NONE if number is None else short(factor * number)

    return form


def _format_bounds(bounds: Document, form: Callable[[Any], str]) -> str:
    interval = between(bounds, form)
    return form(bounds.get("value")) + (f" ({interval})" if interval else "")


def _cells(row: Document, form: Callable[[Any], str]) -> list[str]:
    sides = [part(row, key) for key in _COLUMNS]
    return [cell for side in sides for cell in (form(side.get("value")), between(side, form))]


def _falls(row: Document) -> str:
    """Return the falls in each world, nothing where there was none in any."""
    sides = [part(row, key) for key in _COLUMNS]
    if not any(side.get("falls") for side in sides):
        return ""
    return ", ".join(f"{read_word(side, 'falls')} of {read_word(side, 'episodes')}" for side in sides)


def _plot(comparison: Document, rows: list[Any]) -> Markup | None:
    factor, unit = finite(comparison.get("shown")) or 1.0, read_word(comparison, "unit")
    legend = {"before": "simulator as it was", "after": f"{_second(comparison)} simulator"}
    pairs = []
    for key, kind in (("sim", "before"), ("diagnosed", "after")):
        for row in rows:
            across, up = (_span(part(row, side), factor) for side in ("real", key))
            if across and up:
                pairs.append(Pair(kind, across, up))
    return scatter(pairs, legend, x=f"real [{unit}]", y=f"simulated [{unit}]")


def _span(side: Document, factor: float) -> Span | None:
    value, low, high = (finite(side.get(key)) for key in ("value", "low", "high"))
    if value is None:
        return None
    return Span(factor * value, None if low is None else factor * low, None if high is None else factor * high)
