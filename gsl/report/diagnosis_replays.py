"""Replays of the worst joints: command, real robot, simulator as it was, simulator with the effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from markupsafe import Markup

from gsl.report.charts import Curve, line_chart
from gsl.report.diagnosis_words import Document, entries, finite, read_word, short
from gsl.report.parts import element, section
from gsl.report.shown import Scale, scale_of

SHOWN = 6
_LINES = (
    ("command", "command", "command"),
    ("real", "robot", "real"),
    ("before", "simulator as it was", "before"),
    ("after", "simulator with the effects", "after"),
)


def replays(document: Document) -> Markup | None:
    """Return the replays, angles in degrees, of slides in millimetres."""
    slides = document.get("slides") or []
    drawn = [
        _replay(entry, scale_of(read_word(entry, "joint"), slides)) for entry in entries(document, "replays")[:SHOWN]
    ]
    note = "Held-out records; at every jump the simulator is put where the robot was, then it hears only the commands."
    return section("Replays", *drawn, note=note)


def _replay(entry: Document, scale: Scale) -> Markup | None:
    time, real = [finite(at) for at in entry.get("time") or []], _show(entry.get("real"), scale)
    curves = [Curve(label, kind, time, _show(entry.get(key), scale)) for key, label, kind in _LINES if entry.get(key)]
    chart = line_chart(curves, x="time [s]", y=f"{read_word(entry, 'joint')} [{scale.unit}]")
    if chart is None:
        return None
    distances = [
        f"{short(distance, 2)}{'' if scale.unit == '°' else ' '}{scale.unit} {label}"
        for key, label in (("before", "from the robot as it was"), ("after", "with the effects"))
        if (distance := _rms(_show(entry.get(key), scale), real)) is not None
    ]
    title = f"{read_word(entry, 'joint')} in {read_word(entry, 'record')}" + (
        f": {', '.join(distances)}" if distances else ""
    )
    return element("div", element("h3", title), chart, kind="replay")


def _show(positions: Sequence[Any] | None, scale: Scale) -> list[float | None]:
    numbers = [finite(position) for position in positions or []]
    return [None if number is None else scale.factor * number for number in numbers]


def _rms(first: Sequence[float | None], second: Sequence[float | None]) -> float | None:
    squares = [(a - b) ** 2 for a, b in zip(first, second, strict=False) if a is not None and b is not None]
    return math.sqrt(sum(squares) / len(squares)) if squares else None
