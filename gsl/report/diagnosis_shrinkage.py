"""How far the gap shrinks: bars against the noise floor, as a whole, by joint and by regime."""

from __future__ import annotations

import math
from collections.abc import Sequence

from markupsafe import Markup

from gsl.report.charts import Bar, bar_chart
from gsl.report.diagnosis_verdict import shrinkage_sentence
from gsl.report.diagnosis_words import Document, entries, finite, level, part, read_word, regime, share
from gsl.report.parts import element, join, prose, section

FLOOR = 1.0


def shrinkage(document: Document) -> Markup | None:
    """Return the gap before, with calibration alone, with the effects, and with a learned residual."""
    found = part(document, "shrinkage")
    drawn = bar_chart(_bars(found), mark=finite(found.get("floor")) or FLOOR)
    note = (
        "Gap / noise on held-out records; the dashed line is the noise, below which nothing can be seen. Calibration "
        "is each joint's own small gains, friction and zero. The learned residual is a black box, the forward model of "
        "GAT, fitted to the same records: short logs do not teach it much. Percentages are shares of the squared gap."
    )
    told = element("p", prose(shrinkage_sentence(document))) if drawn else None
    return section("How far the gap shrinks", told, drawn, note=note)


def _bars(found: Document) -> list[Bar]:
    ceiling = _ceiling(found)
    rows = (
        ("simulator as it was", "before", found.get("before"), ""),
        ("calibration alone", "other", found.get("calibration"), ""),
        ("with the effects", "after", found.get("after"), ""),
        ("learned residual, no cause named", "quiet", ceiling, f", {share(found.get('ceiling_fraction'))}"),
    )
    return [
        Bar(label, [(kind, finite(value))], f"{level(value)}{more}")
        for label, kind, value, more in rows
        if finite(value) is not None
    ]


def _ceiling(found: Document) -> float | None:
    """The gap / noise that the learned residual leaves: shares of the excess are shares of squares."""
    before, fraction = finite(found.get("before")), finite(found.get("ceiling_fraction"))
    if before is None or fraction is None:
        return None
    floor = finite(found.get("floor")) or FLOOR
    return math.sqrt(max(0.0, before**2 - fraction * (before**2 - floor**2)))


def parts(document: Document) -> Markup | None:
    """Return the gap before and after, joint by joint and regime by regime."""
    found = part(document, "shrinkage")
    by_joint = [(read_word(one, "joint"), one) for one in entries(found, "by_joint")]
    kinds = [one for one in entries(found, "by_regime") if one.get("regime") != "all"]
    by_regime = [(regime(read_word(one, "regime")), one) for one in kinds]
    drawn = [_pairs(title, rows) for title, rows in (("By joint", by_joint), ("By what the joint did", by_regime))]
    note = "Gap / noise of the simulator as it was (above) and with the effects (below), the worst first."
    return section("Before and after", *drawn, note=note)


def _pairs(title: str, rows: Sequence[tuple[str, Document]]) -> Markup | None:
    ordered = sorted(rows, key=lambda row: -(finite(row[1].get("before")) or 0.0))
    bars = [
        Bar(
            label,
            [(kind, finite(one.get(kind))) for kind in ("before", "after")],
            f"{level(one.get('before'))} → {level(one.get('after'))}",
        )
        for label, one in ordered
    ]
    drawn = bar_chart(bars, mark=FLOOR)
    return join(element("h3", title), drawn) if drawn else None
