"""Curves over a common axis that need no script, and whose words keep their size on any screen."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from gsl.report.diagnosis_html import Html, element
from gsl.report.diagnosis_words import finite

POINTS = 300  # of a line, at most


class Curve(NamedTuple):
    """A line.

    Attributes:
        label: What it is.
        kind: Its class, which has its colour.
        x, y: Of equal length; where either is not a number the line is broken.
    """

    label: str
    kind: str
    x: Sequence[float | None]
    y: Sequence[float | None]


def ticks(low: float, high: float, count: int = 5) -> list[float]:
    """Return about `count` round numbers from `low` to `high`."""
    room = (high - low) or 1.0
    exponent = math.floor(math.log10(room / count))
    step = min((factor * 10.0**exponent for factor in (1, 2, 5, 10)), key=lambda size: abs(room / size - count))
    return [step * index for index in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def line_chart(
    curves: Sequence[Curve], *, x: str, y: str, zero: bool = False, mark: float | None = None
) -> Html | None:
    """Return curves over a common axis with a legend, nothing if there is not a point.

    Args:
        curves: The first is drawn lowest.
        x: Name and unit of the horizontal axis.
        y: Of the vertical one.
        zero: Whether the vertical axis begins at 0.
        mark: Height of a thin line across.
    """
    points = [list(_points(curve)) for curve in curves]
    everything = [point for line in points for point in line if point]
    if not everything:
        return None
    across, heights = [point[0] for point in everything], [point[1] for point in everything]
    heights += [mark] if mark is not None else []
    left, right, low, high = min(across), max(across), 0.0 if zero else min(heights), max(heights)
    room = 0.04 * (high - low) or 0.5
    frame = _Frame(left, right if right > left else left + 1.0, low - (0.0 if zero else room), high + room)
    lines = [_path(frame, curve.kind, line) for curve, line in zip(curves, points, strict=True)]
    return element(
        "figure",
        element("figcaption", y, class_="axis"),
        _plot(frame, lines, mark, f"{y} over {x}"),
        element("p", x, class_="axis right"),
        _legend(curves),
    )


class _Frame(NamedTuple):
    left: float
    right: float
    low: float
    high: float

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Thousandths of the width from the left and of the height from the top."""
        return (
            1000.0 * (x - self.left) / (self.right - self.left),
            1000.0 * (self.high - y) / (self.high - self.low),
        )


def _points(curve: Curve) -> Iterator[tuple[float, float] | None]:
    step = max(1, math.ceil(min(len(curve.x), len(curve.y)) / POINTS))
    for across, height in list(zip(curve.x, curve.y, strict=False))[::step]:
        first, second = finite(across), finite(height)
        yield None if first is None or second is None else (first, second)


def _path(frame: _Frame, kind: str, points: Sequence[tuple[float, float] | None]) -> Html:
    drawn, pen = [], "M"
    for point in points:
        if point is None:
            pen = "M"
            continue
        drawn.append("{}{:.0f} {:.0f}".format(pen, *frame.place(*point)))
        pen = "L"
    return element("path", d="".join(drawn), class_=f"line {kind}")


def _plot(frame: _Frame, lines: Sequence[Html], mark: float | None, title: str) -> Html:
    heights, across = ticks(frame.low, frame.high), ticks(frame.left, frame.right)
    grid = [f"M0 {frame.place(frame.left, height)[1]:.0f}H1000" for height in heights]
    parts = [element("path", d="".join(grid), class_="grid"), *lines]
    if mark is not None:
        parts.append(element("path", d=f"M0 {frame.place(frame.left, mark)[1]:.0f}H1000", class_="line floor"))
    drawn = element(
        "svg", element("title", title), *parts, viewBox="0 0 1000 1000", preserveAspectRatio="none", role="img"
    )
    marks = [tick("y", f"top:{frame.place(frame.left, at)[1] / 10:.1f}%", at) for at in heights]
    marks += [tick("x", f"left:{frame.place(at, frame.low)[0] / 10:.1f}%", at) for at in across]
    return element("div", drawn, *marks, class_="plot")


def tick(axis: str, style: str, at: float) -> Html:
    """Return the number at a tick of the axis `x` or `y`."""
    return element("span", f"{at:.6g}".replace("-", "−"), class_=f"tick {axis}", style=style)


def _legend(curves: Sequence[Curve]) -> Html:
    told = {curve.label: curve.kind for curve in reversed(curves) if curve.label}
    return element("p", *(element("span", swatch(kind), label) for label, kind in told.items()), class_="legend")


def swatch(kind: str) -> Html:
    """Return a short line as it is drawn in a chart."""
    line = element("path", d="M0 5H22", class_=f"line {kind}")
    return element("svg", line, width="22", height="10", aria_hidden="true", class_="swatch")
