"""Charts of a page: curves, bars, dots with whiskers, and pairs; each SVG markup, nothing where there is no number."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from markupsafe import Markup

from gsl.report.style import COMMAND, GROUNDED, HUES, INK, QUIET, REAL, SIMULATION, TICK, figure, look
from gsl.report.svg import WIDTH, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HEIGHT, ROW = 3.0, 0.27  # of curves, and of a row of bars or dots [in]
SIDE, DIGIT, BELOW, END = 0.36, 0.093, 0.5, 0.2  # room left of and below axes, of each digit, and at the end [in]
ABOVE, LINE, COLUMNS = 0.08, 0.19, 2  # room above a legend and for each of its rows [in], and its columns
POINTS = 300  # of a line, at most
LABEL = 30  # letters in a line of a row's label

_DASHES = ("-", (0, (9, 3)), (0, (3, 3)), (0, (9, 3, 2, 3)))
_LINES: Mapping[str, Mapping[str, Any]] = {
    "command": {"color": COMMAND, "linewidth": 1.2, "linestyle": (0, (5, 3))},
    "real": {"color": REAL, "linewidth": 3.0},
    "before": {"color": SIMULATION, "linewidth": 1.8},
    "after": {"color": GROUNDED, "linewidth": 1.8, "linestyle": (0, (9, 3))},
    "quiet": {"color": QUIET, "linewidth": 1.0},
    **{
        f"joint{k}": {"color": hue, "linewidth": 1.8, "linestyle": dash}
        for k, (hue, dash) in enumerate(zip(HUES, _DASHES, strict=True))
    },
}
"""How the lines of each kind are drawn."""
_FILLS = {"before": SIMULATION, "after": GROUNDED, "other": COMMAND, "quiet": QUIET}


class Curve(NamedTuple):
    """A line.

    Attributes:
        label: What it is.
        kind: A key of `_LINES`.
        x, y: Of equal length; where either is None the line is broken.
    """

    label: str
    kind: str
    x: Sequence[float | None]
    y: Sequence[float | None]

    @property
    def points(self) -> list[tuple[float, float]]:
        """Its points, NaN where it is broken."""
        step = max(1, -(-min(len(self.x), len(self.y)) // POINTS))
        pairs = list(zip(self.x, self.y, strict=False))[::step]
        return [(float("nan"),) * 2 if None in pair else pair for pair in pairs]  # type: ignore[misc]


def line_chart(
    curves: Sequence[Curve], *, x: str, y: str, zero: bool = False, mark: float | None = None, counted: bool = False
) -> Markup | None:
    """Return curves over a common axis with a legend.

    Args:
        curves: The first is drawn lowest.
        x: Name and unit of the horizontal axis.
        y: Of the vertical one.
        zero: Whether the vertical axis begins at 0.
        mark: Height of a thin line across.
        counted: Whether the horizontal axis counts, so that only whole numbers stand below it.
    """
    drawn = [(curve, points) for curve in curves if (points := curve.points) if not np.isnan(points).all()]
    if not drawn:
        return None
    with look():
        whole = figure(HEIGHT, WIDTH)
        whole.set_layout_engine(None)  # to ask all words for their size takes longer than all the rest
        axes = whole.subplots()
        labels: dict[str, Any] = {}
        for curve, points in drawn:
            (labels[curve.label],) = axes.plot(*zip(*points, strict=True), **_LINES[curve.kind])
        if mark is not None:
            axes.axhline(mark, color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
        axes.set_ylim(bottom=0.0 if zero else None)
        axes.margins(x=0.0)
        axes.locator_params(axis="x", integer=counted)
        _name(axes, x, y)
        names = [name for name in reversed(labels) if name]
        left, top = _make_room(axes, -(-len(names) // COLUMNS))
        handles = [labels[name] for name in names]
        whole.legend(
            handles, names, loc="lower left", bbox_to_anchor=(left, top), ncols=COLUMNS, frameon=False, fontsize=9.5,
            borderaxespad=0.2, borderpad=0.0,
        )  # fmt: skip
    return svg(whole, "curves")


class Bar(NamedTuple):
    """One or several bars from 0, one below the other.

    Attributes:
        label: What they are.
        lengths: Kind, a key of `_FILLS`, and length of each; those of unknown length are left out.
        text: Said after them.
    """

    label: str
    lengths: Sequence[tuple[str, float | None]]
    text: str


def bar_chart(bars: Sequence[Bar], *, mark: float | None = None) -> Markup | None:
    """Return bars with their values in words; a line marks one length."""
    longest = max((length for bar in bars for _, length in bar.lengths if length is not None), default=None)
    if longest is None:
        return None
    with look():
        rows = [sum(length is not None for _, length in bar.lengths) or 1 for bar in bars]
        whole = figure(0.3 + ROW * sum(max(1.0, 0.8 * row) + 0.25 for row in rows), WIDTH)
        axes = whole.subplots()
        for place, bar in enumerate(bars):
            lengths = [(kind, max(0.0, length)) for kind, length in bar.lengths if length is not None]
            for index, (kind, length) in enumerate(lengths):
                height = 0.8 / len(lengths)
                axes.barh(place - 0.4 + (index + 0.5) * height, length, 0.9 * height, color=_FILLS[kind])
            end = max((length for _, length in lengths), default=0.0)
            axes.annotate(bar.text, (end, place), (5, 0), textcoords="offset points", va="center", fontsize=9.5)
        if mark is not None:
            axes.axvline(mark, color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
        axes.set_xlim(0.0, 1.5 * max(longest, mark or 0.0) or 1.0)
        axes.set_xticks([])
        axes.spines["bottom"].set_visible(False)
        _label_rows(axes, [bar.label for bar in bars])
    return svg(whole, "bars")


class Dot(NamedTuple):
    """A value with its interval.

    Attributes:
        label: What it is of.
        value, low, high: In the unit of the axis, None if unknown.
        kind: A key of `_FILLS`.
    """

    label: str
    value: float | None
    low: float | None
    high: float | None
    kind: str


def dot_chart(dots: Sequence[Dot], form: Callable[[float], str]) -> Markup | None:
    """Return dots with whiskers over a common axis that shows 0.

    Args:
        dots: From above.
        form: How numbers of the axis are written.
    """
    if all(end is None for dot in dots for end in (dot.value, dot.low, dot.high)):
        return None
    with look():
        whole = figure(0.5 + ROW * sum(1.0 + len(_fold(dot.label)) for dot in dots) * 0.75, WIDTH)
        axes = whole.subplots()
        axes.axvline(0.0, color=QUIET, linewidth=1.0)
        for place, dot in enumerate(dots):
            colour = _FILLS[dot.kind]
            if dot.low is not None and dot.high is not None:
                axes.hlines(place, dot.low, dot.high, color=colour, linewidth=2.0)
            if dot.value is not None:
                axes.plot([dot.value], [place], "o", color=colour, markersize=7)
        axes.xaxis.set_major_formatter(lambda at, _: form(at))
        axes.locator_params(axis="x", nbins=5)
        _label_rows(axes, [dot.label for dot in dots])
    return svg(whole, "values with their intervals")


class Span(NamedTuple):
    """A value with its interval, whose ends are None where there is none."""

    value: float
    low: float | None = None
    high: float | None = None


class Pair(NamedTuple):
    """A dot: its kind, a key of `_FILLS`, and where it is, with whiskers."""

    kind: str
    x: Span
    y: Span


def scatter(pairs: Sequence[Pair], legend: Mapping[str, str], *, x: str, y: str) -> Markup | None:
    """Return dots with whiskers on axes of one scale, with the line on which both values agree.

    Args:
        pairs: The first is drawn lowest.
        legend: What the dots of each kind are.
        x: Name and unit of the horizontal axis.
        y: Of the vertical one.
    """
    values = [span.value for pair in pairs for span in (pair.x, pair.y)]
    if not values:
        return None
    room = 0.08 * (max(values) - min(values)) or 0.5
    ends = min(values) - room, max(values) + room
    with look():
        whole = figure(0.8 * WIDTH, WIDTH)
        axes = whole.subplots()
        axes.plot(ends, ends, color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
        for pair in pairs:
            colour = _FILLS[pair.kind]
            if pair.x.low is not None and pair.x.high is not None:
                axes.hlines(pair.y.value, pair.x.low, pair.x.high, color=colour, linewidth=1.0)
            if pair.y.low is not None and pair.y.high is not None:
                axes.vlines(pair.x.value, pair.y.low, pair.y.high, color=colour, linewidth=1.0)
            axes.plot([pair.x.value], [pair.y.value], "o", color=colour, markersize=7, label=legend[pair.kind])
        axes.set(xlim=ends, ylim=ends, aspect="equal")
        _name(axes, x, y)
        handles = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
        whole.legend(handles.values(), handles, loc="outside upper left", ncols=2, frameon=False, fontsize=9.5)
    return svg(whole, "pairs of values")


def _make_room(axes: Axes, rows: int) -> tuple[float, float]:
    """Place axes between their labels and a legend of so many rows; return its left and top edge, as shares."""
    ticks = axes.yaxis.get_major_formatter().format_ticks(list(axes.get_yticks()))
    left = (SIDE + DIGIT * max(map(len, ticks), default=0)) / WIDTH
    low, top = BELOW / HEIGHT, 1.0 - (ABOVE + LINE * rows) / HEIGHT
    axes.set_position((left, low, 1.0 - END / WIDTH - left, top - low))
    return left, top


def _name(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(axis="y", color=QUIET, linewidth=0.5)


def _label_rows(axes: Axes, labels: Sequence[str]) -> None:
    axes.set_yticks(range(len(labels)), ["\n".join(_fold(label)) for label in labels])
    axes.tick_params(axis="y", length=0, labelcolor=TICK, labelsize=9.5)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.spines["left"].set_visible(False)


def _fold(label: str) -> list[str]:
    return textwrap.wrap(label, LABEL) or [""]
