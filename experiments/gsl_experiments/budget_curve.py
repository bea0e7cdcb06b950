"""Return and grounding error against the number of real trajectories, each method a line with its 95 % interval."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gsl.core.statistics import Interval
from gsl.report.style import COMMAND, figure, headline, label_ends, look, method_colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Line(NamedTuple):
    """A figure at each budget."""

    budgets: Sequence[int]
    intervals: Sequence[Interval]


def budget_curve_figure(panels: Mapping[str, Mapping[str, Line]], bases: Mapping[str, float], title: str) -> Figure:
    """Return the figure.

    Args:
        panels: What is shown, with its unit, and in each the methods.
        bases: What it is without any real trajectory, by panel.
        title: What there is to see.
    """
    with look():
        whole = figure(3.6)
        for axes, (name, lines) in zip(whole.subplots(1, len(panels), squeeze=False)[0], panels.items(), strict=True):
            _draw(axes, lines, bases.get(name))
            axes.set_ylabel(name)
            axes.set_xlabel("real trajectories")
        headline(whole, title)
    return whole


def _draw(axes: Axes, lines: Mapping[str, Line], base: float | None) -> None:
    ends = []
    for method, line in lines.items():
        colour = method_colour(method)
        means = [interval.mean for interval in line.intervals]
        bounds = np.array([[interval.lower, interval.upper] for interval in line.intervals]).T
        axes.plot(line.budgets, means, "o-", color=colour, markersize=4)
        if np.isfinite(bounds).all():
            axes.fill_between(line.budgets, *bounds, color=colour, alpha=0.18, linewidth=0)
        ends.append((means[-1], method, colour))
    if base is not None:
        first, last = (function(line.budgets[k] for line in lines.values()) for k, function in ((0, min), (-1, max)))
        axes.hlines(base, first, last, color=COMMAND, linewidth=1.0, linestyle=(0, (5, 3)))
        ends.append((base, "none", COMMAND))
    axes.margins(y=0.12)
    label_ends(axes, float(max(line.budgets[-1] for line in lines.values())), ends, gap=0.1)
