"""Replays of the worst joints: command, real robot, simulator as it was, simulator with the effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from markupsafe import Markup

from gsl.report.charts import Curve, line_chart
from gsl.report.diagnosis_words import Document, entries, finite, read_word, short
from gsl.report.parts import element, section

SHOWN = 6
_LINES = (
    ("command", "command", "command"),
    ("real", "robot", "real"),
    ("before", "simulator as it was", "before"),
    ("after", "simulator with the effects", "after"),
)


def replays(document: Document) -> Markup | None:
    """Return the replays, angles in degrees."""
    drawn = [_replay(entry) for entry in entries(document, "replays")[:SHOWN]]
    note = "Held-out records; at every jump the simulator is put where the robot was, then it hears only the commands."
    return section("Replays", *drawn, note=note)


def _replay(entry: Document) -> Markup | None:
    time, real = [finite(at) for at in entry.get("time") or []], _degrees(entry.get("real"))
    curves = [Curve(label, kind, time, _degrees(entry.get(key))) for key, label, kind in _LINES if entry.get(key)]
    chart = line_chart(curves, x="time [s]", y=f"{read_word(entry, 'joint')} [°]")
    if chart is None:
        return None
    distances = [
        f"{short(distance, 2)}° {label}"
        for key, label in (("before", "from the robot as it was"), ("after", "with the effects"))
        if (distance := _rms(_degrees(entry.get(key)), real)) is not None
    ]
    title = f"{read_word(entry, 'joint')} in {read_word(entry, 'record')}" + (
        f": {', '.join(distances)}" if distances else ""
    )
    return element("div", element("h3", title), chart, kind="replay")


def _degrees(angles: Sequence[Any] | None) -> list[float | None]:
    numbers = [finite(angle) for angle in angles or []]
    return [None if number is None else math.degrees(number) for number in numbers]


def _rms(first: Sequence[float | None], second: Sequence[float | None]) -> float | None:
    squares = [(a - b) ** 2 for a, b in zip(first, second, strict=False) if a is not None and b is not None]
    return math.sqrt(sum(squares) / len(squares)) if squares else None
