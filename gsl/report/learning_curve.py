"""The learning curve: what each generation's best is worth in simulation, and what in real."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from gsl.core.words import in_unit
from gsl.report.style import (
    COMMAND,
    INK,
    REAL,
    SIMULATION,
    WIDTH,
    curve_figure,
    headline,
    label_ends,
    label_gap,
    look,
    save,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Point(NamedTuple):
    """One policy.

    Attributes:
        generation: 0 for the policy that a search starts from.
        simulated: Value in simulation, if known.
        real: Mean value in real.
        lower, upper: 95 % interval of the real value, infinite where one episode is all there is.
        falls: In real, of the choice; a policy that falls once is unstable.
        later: Falls in its check or in the report.
    """

    generation: int
    simulated: float | None
    real: float
    lower: float
    upper: float
    falls: int
    later: int = 0


class Search(NamedTuple):
    """One search for a policy, drawn as one panel.

    Attributes:
        label: What it was, such as `iteration 1`.
        points: Where it starts, then the best of each generation.
        confirmed: The returned policy measured again on fresh episodes, if it was.
        start: Name of the policy where it starts.
    """

    label: str
    points: Sequence[Point]
    confirmed: Point | None = None
    start: str = "π0"


def search(
    label: str, evaluation: Mapping[str, Any], *, shown: float = 1.0, returned: str | None = None, start: str = "π0"
) -> Search:
    """Return what an `evaluation.json` holds; the start has its value of the report, as in the table.

    Args:
        label: Heading of its panel.
        evaluation: The document.
        shown: What values are multiplied by for people, `Task.shown`.
        returned: Name of the policy that was chosen.
        start: Name for people of the policy where the search starts.
    """
    fresh = {row["name"]: row for row in evaluation["confirmation"]}
    best = fresh.get(returned or "")
    confirmed = _point(best, shown) if best and best["generation"] else None
    later = [(row["name"], row["falls"]) for phase in ("check", "confirmation") for row in evaluation[phase]]
    winners = [
        point._replace(later=sum(falls for name, falls in later if name == row["name"]))
        for row, point in zip(evaluation["policies"], points(evaluation["policies"], shown=shown), strict=True)
    ]
    if (begun := evaluation["policies"][0]["name"]) in fresh:
        winners[0] = _point(fresh[begun], shown)._replace(later=winners[0].later)
    return Search(label, winners, confirmed, start)


def points(rows: Sequence[Mapping[str, Any]], *, shown: float = 1.0) -> list[Point]:
    """Return rows of an `evaluation.json`, values multiplied by `shown`."""
    return [_point(row, shown) for row in rows]


def learning_curve(path: Path, searches: Sequence[Search], *, unit: str, title: str) -> None:
    """Write the figure of the searches as a PNG file; arguments as those of `learning_curve_figure`."""
    save(learning_curve_figure(searches, unit=unit, title=title), path)


def learning_curve_figure(
    searches: Sequence[Search], *, unit: str, title: str = "", width: float = WIDTH, among: Sequence[Search] = ()
) -> Figure:
    """Return the figure of the searches.

    Args:
        searches: Panels from left to right.
        unit: Of all values.
        title: The finding, in a line.
        width: Of the figure [in].
        among: Searches that have the same scale.
    """
    with look():
        whole = curve_figure(width)
        panels = whole.subplots(1, len(searches), sharey=True, squeeze=False)[0]
        falls = any(point.falls for search in (*searches, *among) for point in search.points)
        _scale(panels[0], *_limits([*searches, *among]), strip=falls)
        for axes, search in zip(panels, searches, strict=True):
            _draw(axes, search, label_gap(0.12, whole))
            axes.tick_params(labelleft=True)
        panels[0].set_ylabel(in_unit("value", unit) if unit else "return of an episode")
        headline(whole, title)
    return whole


def _point(row: Mapping[str, Any], shown: float) -> Point:
    lower, upper = row["interval"]
    return Point(
        row["generation"] or 0,
        None if row["value_sim"] is None else shown * row["value_sim"],
        shown * row["value"],
        -math.inf if lower is None else shown * lower,
        math.inf if upper is None else shown * upper,
        row["falls"],
    )


def _limits(searches: Sequence[Search]) -> tuple[float, float]:
    """Least and greatest value that is drawn."""
    points = [point for search in searches for point in search.points]
    again = [search.confirmed for search in searches if search.confirmed]
    values = [point.simulated for point in (*points, *again) if point.simulated is not None]
    values += [search.points[0].real for search in searches]
    for point in (*again, *(point for point in points if not point.falls)):  # winners that fell are in the strip
        values += [bound for bound in (point.real, point.lower, point.upper) if math.isfinite(bound)]
    return min(values), max(values)


def _scale(axes: Axes, low: float, high: float, *, strip: bool) -> None:
    """Make room for the values and, below them, for a strip without ticks that shows falls, if there are any."""
    from matplotlib.ticker import MaxNLocator

    room = (high - low) or abs(high) or 1.0
    bottom, top = low - (0.25 if strip else 0.1) * room, high + 0.08 * room
    ticks = MaxNLocator(nbins=7, steps=[1, 2, 5, 10]).tick_values(bottom, top)
    axes.set_yticks([tick for tick in ticks if low - 0.08 * room <= tick <= top])
    axes.set_ylim(bottom, top)


def _draw(axes: Axes, search: Search, gap: float) -> None:
    start, last = search.points[0], search.points[-1].generation
    simulated = [(point.generation, point.simulated) for point in search.points if point.simulated is not None]
    standing = [point for point in search.points if not point.falls]
    axes.axhline(start.real, color=COMMAND, linewidth=1.2, linestyle=(0, (5, 4)), zorder=1, label=search.start)
    if simulated:
        axes.plot(*zip(*simulated, strict=True), "-o", color=SIMULATION, markersize=4.5, label="simulation")
    _draw_standing(axes, standing)
    _draw_falls(axes, [point for point in search.points if point.falls])
    if search.confirmed is not None:
        _draw_confirmed(axes, search.confirmed)
    axes.set_title(search.label, loc="left", fontsize=10.5)
    axes.set_xlabel("generation")
    axes.set_xticks([point.generation for point in search.points])
    axes.set_xlim(-0.4, max(1, last) + 0.4)
    ends = [(start.real, f"{search.start} on the real side", COMMAND)]
    ends += [(simulated[-1][1], "best in\nsimulation", SIMULATION)] if simulated else []
    ends += [(standing[-1].real, "the same,\nreal side", REAL)] if standing and standing[-1].generation > 0 else []
    ends += [(search.confirmed.real, "chosen,\nmeasured again", INK)] if search.confirmed else []
    label_ends(axes, axes.get_xlim()[1], ends, gap=gap)


def _draw_standing(axes: Axes, standing: Sequence[Point]) -> None:
    """Draw what did not fall in the choice, hollow where it did later."""
    generations, values = [point.generation for point in standing], [point.real for point in standing]
    bounded = [point for point in standing if math.isfinite(point.lower) and math.isfinite(point.upper)]
    fallen = [(point.generation, point.real) for point in standing if point.later]
    axes.plot(generations, values, ":", color=REAL, linewidth=1.0, zorder=2)
    axes.plot(generations, values, "o", color=REAL, markersize=7, label="real", zorder=4)
    lower, upper = [point.lower for point in bounded], [point.upper for point in bounded]
    axes.vlines([point.generation for point in bounded], lower, upper, color=REAL, linewidth=1.8, zorder=3)
    if fallen:
        axes.plot(*zip(*fallen, strict=True), "o", color=REAL, markerfacecolor="white", label="fell later", zorder=5)
        for place, value in fallen:
            _say(axes, "fell later", place, value, 9, REAL, side="right")  # the bar of the confirmation is beside it


def _draw_falls(axes: Axes, fallen: Sequence[Point]) -> None:
    if not fallen:
        return
    low, high = axes.get_ylim()
    places, strip = [point.generation for point in fallen], low + 0.05 * (high - low)
    axes.plot(places, [strip] * len(places), "x", color=REAL, markersize=8, markeredgewidth=2.0, label="fell")
    _say(axes, "fell on the real side", sum(places) / len(places), strip, 9, REAL)


def _draw_confirmed(axes: Axes, confirmed: Point) -> None:
    place = confirmed.generation + 0.18
    axes.vlines([place], [confirmed.lower], [confirmed.upper], color=INK, linewidth=1.8, zorder=5)
    axes.plot([place], [confirmed.real], "D", color=INK, markersize=6, label="measured again", zorder=6)


def _say(axes: Axes, text: str, x: float, y: float, above: float, colour: str, side: str = "center") -> None:
    """Write something above a point, with its middle or its right end there."""
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=3.0, foreground="white")]
    place: dict[str, Any] = {
        "path_effects": halo,
        "xytext": (0, above),
        "textcoords": "offset points",
        "ha": side,
        "fontsize": 9.5,
    }
    axes.annotate(text, (x, y), color=colour, zorder=7, **place)
