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
    """Return the gap before, with calibration alone, with the effects, and with a law of each servo on top."""
    figures = part(document, "shrinkage")
    drawn = bar_chart(_bars(figures), mark=finite(figures.get("floor")) or FLOOR)
    note = (
        "Gap / noise on held-out records; the dashed line is the noise, below which nothing can be seen. Calibration "
        "is each joint's own small gains, friction and zero. The ceiling is what any servo could explain: a small law "
        "of each joint, learned on top of the best effects. Percentages are shares of the squared gap."
    )
    sentence = element("p", prose(shrinkage_sentence(document))) if drawn else None
    return section("How far the gap shrinks", sentence, drawn, note=note)


def _bars(figures: Document) -> list[Bar]:
    ceiling = _ceiling(figures)
    rows = (
        ("simulator as it was", "before", figures.get("before"), ""),
        ("calibration alone", "other", figures.get("calibration"), ""),
        ("with the effects", "after", figures.get("after"), ""),
        ("ceiling: a law of each servo on top", "quiet", ceiling, f", {share(figures.get('ceiling_fraction'))}"),
    )
    return [
        Bar(label, [(kind, finite(value))], f"{level(value)}{more}")
        for label, kind, value, more in rows
        if finite(value) is not None
    ]


def _ceiling(figures: Document) -> float | None:
    """The gap / noise that laws of the servos leave: shares of the excess are shares of squares."""
    before, fraction = finite(figures.get("before")), finite(figures.get("ceiling_fraction"))
    if before is None or fraction is None:
        return None
    floor = finite(figures.get("floor")) or FLOOR
    return math.sqrt(max(0.0, before**2 - fraction * (before**2 - floor**2)))


def parts(document: Document) -> Markup | None:
    """Return the gap before and after, joint by joint and regime by regime."""
    figures = part(document, "shrinkage")
    by_joint = [(read_word(entry, "joint"), entry) for entry in entries(figures, "by_joint")]
    kinds = [entry for entry in entries(figures, "by_regime") if entry.get("regime") != "all"]
    by_regime = [(regime(read_word(entry, "regime")), entry) for entry in kinds]
    drawn = [_pairs(title, rows) for title, rows in (("By joint", by_joint), ("By what the joint did", by_regime))]
    note = (
        "Gap / noise on held-out records, of the simulator as it was (above) and with the effects (below), worst first."
    )
    return section("Before and after", *drawn, note=note)


def _pairs(title: str, rows: Sequence[tuple[str, Document]]) -> Markup | None:
    ordered = sorted(rows, key=lambda row: -(finite(row[1].get("before")) or 0.0))
    bars = [
        Bar(
            label,
            [(kind, finite(entry.get(kind))) for kind in ("before", "after")],
            f"{level(entry.get('before'))} → {level(entry.get('after'))}",
        )
        for label, entry in ordered
    ]
    drawn = bar_chart(bars, mark=FLOOR)
    return join(element("h3", title), drawn) if drawn else None
