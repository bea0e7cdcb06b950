"""Bars, and dots with whiskers, one a row between its label and its value in words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from gsl.report.diagnosis_curves import ticks
from gsl.report.diagnosis_html import Html, Part, element, join

THICK, ROOM = 11, 3  # of a bar and around it [px]


class Bar(NamedTuple):
    """One or several bars from 0, one below the other.

    Attributes:
        label: What they are.
        lengths: Class, which has the colour, and length of each; those of unknown length are left out.
        text: Said after them.
    """

    label: Part
    lengths: Sequence[tuple[str, float | None]]
    text: Part


def bar_chart(bars: Sequence[Bar], *, mark: float | None = None) -> Html | None:
    """Return bars with their values in words, nothing if there are none; a line marks one length."""
    lengths = [length for bar in bars for _, length in bar.lengths if length is not None]
    if not lengths:
        return None
    longest = 1.02 * max([*lengths, mark or 0.0]) or 1.0
    return element("div", *(_bar(bar, longest, mark) for bar in bars), class_="bars")


def _bar(bar: Bar, longest: float, mark: float | None) -> Html:
    known = [(kind, max(0.0, length)) for kind, length in bar.lengths if length is not None]
    height = 2 * ROOM + THICK * max(1, len(known))
    shapes = [
        element(
            "rect",
            y=ROOM + THICK * index,
            width=f"{100.0 * length / longest:.2f}%",
            height=THICK - 1,
            class_=f"fill {kind}",
        )
        for index, (kind, length) in enumerate(known)
    ]
    if mark is not None:
        shapes.append(_upright(f"{100.0 * mark / longest:.2f}%", height, "floor"))
    return _row(bar.label, shapes, height, bar.text)


class Dot(NamedTuple):
    """A value with its interval.

    Attributes:
        label: What it is of.
        value, low, high: In the unit of the axis, None if unknown.
        text: Said after it.
        kind: Its class, which has its colour.
    """

    label: Part
    value: float | None
    low: float | None
    high: float | None
    text: Part
    kind: str


def dot_chart(dots: Sequence[Dot], form: Callable[[float], str]) -> Html | None:
    """Return dots with whiskers over a common axis that shows 0, nothing if there are none.

    Args:
        dots: From above.
        form: How numbers of the axis are told.
    """
    ends = [end for dot in dots for end in (dot.value, dot.low, dot.high) if end is not None]
    if not ends:
        return None
    low, high = min(0.0, *ends), max(0.0, *ends)
    room = 0.04 * (high - low) or 1.0
    low, high = low - room, high + room

    def place(at: float) -> str:
        return f"{100.0 * (at - low) / (high - low):.2f}%"

    marks = [element("text", form(at), x=place(at), y=12, text_anchor="middle") for at in ticks(low, high, 4)]
    rows = [_row(dot.label, _dot(dot, place), 18, dot.text) for dot in dots]
    return element("div", *rows, _row(None, marks, 18, None), class_="bars dots")


def _dot(dot: Dot, place: Callable[[float], str]) -> list[Html]:
    parts = [_upright(place(0.0), 18, "floor")]
    if dot.low is not None and dot.high is not None:
        parts.append(element("line", x1=place(dot.low), x2=place(dot.high), y1=9, y2=9, class_=f"line {dot.kind}"))
    if dot.value is not None:
        parts.append(element("circle", cx=place(dot.value), cy=9, r=5, class_=f"fill {dot.kind}"))
    return parts


def _upright(place: str, height: int, kind: str) -> Html:
    return element("line", x1=place, x2=place, y1=0, y2=height, class_=f"line {kind}")


def _row(label: Part, shapes: Sequence[Html], height: int, text: Part) -> Html:
    track = element("svg", join(*shapes), width="100%", height=height, aria_hidden="true")
    parts = (("label", label), ("track", track), ("number", text))
    return element("div", *(element("div", part, class_=kind) for kind, part in parts), class_="row")
