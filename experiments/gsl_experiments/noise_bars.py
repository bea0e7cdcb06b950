"""Return at each noise of the real world, or after each round: bars with standard errors, a line for training there.

As the paper's figures 12 and 13: models of striped bars knew no real data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gsl.report.style import REAL, figure, headline, look, method_colour

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HATCHES = ("///", "...", "xxx")  # of what uses no real data: of several widths of action noise, in turn


class Bars(NamedTuple):
    """Means and standard errors of each method at each tick."""

    ticks: Sequence[str]
    values: Mapping[str, Sequence[tuple[float, float]]]


def noise_bars_figure(
    panels: Mapping[str, Bars], reference: str, *, title: str, along: str, alike: bool = False
) -> Figure:
    """Return the figure.

    Args:
        panels: By real world.
        reference: The method that is drawn as a line, its error as a band.
        title: What there is to see.
        along: What the ticks are.
        alike: Whether the panels share their scale, as the returns of one environment do.
    """
    with look():
        whole = figure(3.8)
        grid = whole.subplots(1, len(panels), squeeze=False, sharey=alike)
        for axes, (name, bars) in zip(grid[0], panels.items(), strict=True):
            methods = [method for method in bars.values if method != reference]
            places, width = np.arange(len(bars.ticks)), 0.8 / max(1, len(methods))
            noisy = [method for method in methods if method.startswith("ane")]
            for k, method in enumerate(methods):
                means, errors = np.array(bars.values[method]).T
                hatch = HATCHES[0] if method == "none" else ""
                if method in noisy:
                    hatch = HATCHES[noisy.index(method) % len(HATCHES)]
                x, colour = places + (k - 0.5 * (len(methods) - 1)) * width, method_colour(method)
                axes.bar(
                    x, means, 0.92 * width, yerr=errors, color=colour, hatch=hatch, edgecolor="white", label=method
                )
            for place, (mean, error) in zip(places, bars.values.get(reference, ()), strict=False):
                label, ends = reference if place == 0 else None, (place - 0.45, place + 0.45)
                axes.fill_between(ends, mean - error, mean + error, color=REAL, alpha=0.15, linewidth=0)
                axes.hlines(mean, *ends, color=REAL, linestyle="--", linewidth=1.4, label=label)
            axes.set_xticks(places, bars.ticks)
            axes.set_ylabel("" if alike and axes is not grid[0, 0] else "return on the real side")
            axes.set_title(name, loc="left", fontsize=10.5)
        whole.legend(*axes.get_legend_handles_labels(), loc="outside right upper", frameon=False, fontsize=9)
        if along:
            whole.supxlabel(along, fontsize="medium")
        headline(whole, title)
    return whole
