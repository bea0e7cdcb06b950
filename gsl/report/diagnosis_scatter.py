"""Values told against values measured: one dot a pair, on axes of one scale, with the line on which both agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from gsl.report.diagnosis_curves import tick, ticks
from gsl.report.diagnosis_html import Html, element

RADIUS = 5  # of a dot [px]


class Span(NamedTuple):
    """A value with its interval, whose ends are None where there is none."""

    value: float
    low: float | None = None
    high: float | None = None


class Pair(NamedTuple):
    """A dot.

    Attributes:
        label: Said when the pointer is on it.
        kind: Its class, which has its colour.
        x, y: Where it is, with whiskers.
    """

    label: str
    kind: str
    x: Span
    y: Span


def scatter(pairs: Sequence[Pair], legend: Mapping[str, str], *, x: str, y: str) -> Html | None:
    """Return dots with whiskers, cut off at the frame, nothing if there is not a dot.

    Args:
        pairs: The first is drawn lowest.
        legend: What the dots of each class are.
        x: Name and unit of the horizontal axis.
        y: Of the vertical one.
    """
    values = [span.value for pair in pairs for span in (pair.x, pair.y)]
    if not values:
        return None
    room = 0.08 * (max(values) - min(values)) or 0.5
    scale = _Scale(min(values) - room, max(values) + room)
    line = element("line", x1="0%", y1="100%", x2="100%", y2="0%", class_="line floor")
    drawn = element("svg", element("title", f"{y} over {x}"), line, *(_dot(scale, pair) for pair in pairs), role="img")
    at = ticks(scale.low, scale.high)
    marks = [tick("y", f"top:{100.0 - scale.share(one):.1f}%", one) for one in at]
    marks += [tick("x", f"left:{scale.share(one):.1f}%", one) for one in at]
    return element(
        "figure",
        element("figcaption", y, class_="axis"),
        element("div", drawn, *marks, class_="plot square dots"),
        element("p", x, class_="axis right square"),
        element("p", *(element("span", _swatch(kind), told) for kind, told in legend.items()), class_="legend"),
    )


class _Scale(NamedTuple):
    low: float
    high: float

    def share(self, value: float) -> float:
        """Hundredths of the way along an axis, not beyond its ends."""
        return min(100.0, max(0.0, 100.0 * (value - self.low) / (self.high - self.low)))


def _dot(scale: _Scale, pair: Pair) -> Html:
    across, up = scale.share(pair.x.value), 100.0 - scale.share(pair.y.value)
    parts = [element("title", pair.label)]
    if pair.x.low is not None and pair.x.high is not None:
        ends = scale.share(pair.x.low), scale.share(pair.x.high)
        parts.append(_whisker(pair.kind, (ends[0], up), (ends[1], up)))
    if pair.y.low is not None and pair.y.high is not None:
        ends = 100.0 - scale.share(pair.y.low), 100.0 - scale.share(pair.y.high)
        parts.append(_whisker(pair.kind, (across, ends[0]), (across, ends[1])))
    parts.append(element("circle", cx=f"{across:.2f}%", cy=f"{up:.2f}%", r=RADIUS, class_=f"fill {pair.kind}"))
    return element("g", *parts)


def _whisker(kind: str, start: tuple[float, float], end: tuple[float, float]) -> Html:
    places = {"x1": start[0], "y1": start[1], "x2": end[0], "y2": end[1]}
    told = {key: f"{place:.2f}%" for key, place in places.items()}
    return element("line", class_=f"line thin {kind}", **told)


def _swatch(kind: str) -> Html:
    dot = element("circle", cx=6, cy=5, r=RADIUS - 1, class_=f"fill {kind}")
    return element("svg", dot, width="12", height="10", aria_hidden="true", class_="swatch")
