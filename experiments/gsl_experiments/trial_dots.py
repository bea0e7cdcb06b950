"""Trials of methods side by side: every trial a dot, the mean a line, its 95 % interval a bar; one panel a world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gsl.core.statistics import mean_interval
from gsl.report.style import INK, QUIET, figure, headline, look

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

APART, WIDEST = 0.13, 0.3  # of dots that would cover each other, and of all of them from their row, in rows
CLOSE = 0.015  # of the range of all values


class Dots(NamedTuple):
    """A method's trials: values, shape (n,), which of them failed, shape (n,), and its colour."""

    values: Sequence[float]
    failed: Sequence[bool]
    colour: str = INK


def trial_dots_figure(panels: Mapping[str, Mapping[str, Dots]], *, axis: str, title: str) -> Figure:
    """Return the figure.

    Args:
        panels: Worlds by name, in each the methods by name, from above.
        axis: What is shown, with its unit.
        title: What there is to see.
    """
    most = max(len(methods) for methods in panels.values())
    spanned = float(
        np.ptp([value for methods in panels.values() for dots in methods.values() for value in dots.values])
    )
    with look():
        whole = figure(1.4 + 0.32 * most)
        for axes, (world, methods) in zip(
            whole.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False)[0], panels.items(), strict=True
        ):
            draw_methods(axes, methods, CLOSE * spanned)
            axes.set_title(world, loc="left", fontsize=10.5)
        whole.supxlabel(axis, fontsize="medium")
        headline(whole, title)
    return whole


def draw_methods(axes: Axes, methods: Mapping[str, Dots], close: float) -> None:
    """Draw the methods, from above; dots nearer to each other than `close` are moved apart."""
    axes.axvline(0.0, color=QUIET, linewidth=1.0, zorder=0)
    for row, dots in enumerate(methods.values()):
        values, failed = np.asarray(dots.values, float), np.asarray(dots.failed, bool)
        interval = mean_interval(values)
        if np.isfinite(interval.lower):
            axes.hlines(row, interval.lower, interval.upper, color=dots.colour, linewidth=6, alpha=0.25)
        axes.plot([interval.mean] * 2, [row - 0.3, row + 0.3], color=dots.colour, linewidth=2.2)
        for part, face in ((~failed, dots.colour), (failed, "white")):
            heights = row + _apart(values, close)[part]
            axes.plot(values[part], heights, "o", color=dots.colour, markerfacecolor=face, markersize=4.5)
    axes.set_yticks(range(len(methods)), list(methods))
    axes.set_ylim(len(methods) - 0.5, -0.5)
    axes.tick_params(axis="y", length=0)


def _apart(values: np.ndarray, close: float) -> np.ndarray:
    """Return how far each dot is moved out of its row, shape (n,), so that those at one place are all seen."""
    order, moved = np.argsort(values, kind="stable"), np.zeros(len(values))
    for alike in np.split(order, np.flatnonzero(np.diff(values[order]) > close) + 1):
        wide = min(0.5 * APART * (len(alike) - 1), WIDEST)
        moved[alike] = np.linspace(-wide, wide, len(alike))
    return moved
