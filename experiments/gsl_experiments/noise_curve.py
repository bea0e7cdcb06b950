"""Return against the noise of the real world: each method a line with its 95 % interval, exact values dashed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gsl.core.statistics import Interval
from gsl.report.style import COMMAND, figure, headline, look, method_colour

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Curve(NamedTuple):
    """Values at each noise."""

    noises: Sequence[float]
    intervals: Sequence[Interval]


def noise_curve_figure(curves: Mapping[str, Curve], exact: Mapping[str, Sequence[float]], title: str) -> Figure:
    """Return the figure.

    Args:
        curves: By method.
        exact: Values to compare with, at the same noises, by name.
        title: What there is to see.
    """
    with look():
        whole = figure(4.4)
        axes, ends = whole.subplots(), []
        noises = next(iter(curves.values())).noises
        for name, values in exact.items():
            axes.plot(noises, values, color=COMMAND, linewidth=1.2, linestyle=(0, (5, 3)), zorder=4)
            middle = int(0.45 * len(noises))
            axes.annotate(name, (noises[middle], values[middle]), (8, 8), textcoords="offset points", color=COMMAND)
        for name, curve in curves.items():
            colour = method_colour(name)
            means = [interval.mean for interval in curve.intervals]
            bounds = np.array([(interval.lower, interval.upper) for interval in curve.intervals]).T
            axes.plot(noises, means, "o-", color=colour, markersize=4)
            if np.isfinite(bounds).all():
                axes.fill_between(noises, *bounds, color=colour, alpha=0.2, linewidth=0)
            place = int(0.55 * len(noises))
            ends.append((place, means[place], name, colour))
        for place, height, name, colour in ends:
            axes.annotate(name, (noises[place], height), (-26, -14), textcoords="offset points", color=colour)
        axes.set_xlabel("chance that the real world replaces an action")
        axes.set_ylabel("return on the real side, 95 % interval shaded")
        headline(whole, title)
    return whole
