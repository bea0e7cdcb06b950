"""How joints move beside how they yield: a line a method, its replay error at the left, its shares at the right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gsl.report.style import INK, QUIET, figure, headline, look
from gsl_experiments.trial_dots import CLOSE, Dots, draw_methods

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

APART = 0.17  # of stiffness and strength from their method's line, in lines
MARGIN = 0.25  # of the axis of shares, beyond simulator and robot at least
MARKERS = {"stiffness": ("o", -APART), "strength": ("s", APART)}


class Shares(NamedTuple):
    """Share of the gap that is closed joint by joint in each trial, 1 at best; empty where nobody knows."""

    stiffness: Sequence[float]
    strength: Sequence[float]


def move_and_yield_figure(
    moving: Mapping[str, Mapping[str, Dots]], yielding: Mapping[str, Mapping[str, Shares]], *, group: str
) -> Figure:
    """Return the figure.

    Args:
        moving: Worlds by name, in each the methods by name, from above: replay errors [deg].
        yielding: How much of the gap to the real robot's compliance the same methods close.
        group: Of joints, whose compliance it is.
    """
    most = max(len(methods) for methods in moving.values())
    spanned = float(
        np.ptp([value for methods in moving.values() for dots in methods.values() for value in dots.values])
    )
    with look():
        whole = figure(0.6 + len(moving) * (1.1 + 0.32 * most))
        axes = whole.subplots(len(moving), 2, sharex="col", sharey="row", squeeze=False)
        for (left, right), (world, methods) in zip(axes, moving.items(), strict=True):
            draw_methods(left, methods, CLOSE * spanned)
            left.set_title(f"{world}: how joints move", loc="left", fontsize=10.5)
            lacking = [
                name for name in MARKERS if not any(len(getattr(shares, name)) for shares in yielding[world].values())
            ]
            same = f"; no gap in {' and '.join(lacking)}" if lacking else ""
            right.set_title(f"how {group} yield{same}", loc="left", fontsize=10.5)
            _draw(right, yielding[world], [dots.colour for dots in methods.values()])
            right.tick_params(axis="y", length=0, labelleft=False)
        left, right = axes[-1]
        left.set_xlabel("joints off the real ones after 0.2 s [°]")
        right.set_xlabel("gap closed joint by joint (● stiffness, ■ strength)")
        headline(whole, "Joints that move like the robot's need not yield like them; each trial a mark")
    return whole


def _draw(axes: Axes, methods: Mapping[str, Shares], colours: Sequence[str]) -> None:
    for place, name in ((0.0, "simulator"), (1.0, "robot")):
        axes.axvline(place, color=QUIET, linewidth=1.0, zorder=0)
        axes.annotate(
            name, (place, 0.0), xycoords=("data", "axes fraction"), ha="center", va="bottom", fontsize=9, color=INK
        )
    for row, (shares, colour) in enumerate(zip(methods.values(), colours, strict=True)):
        for name, (marker, apart) in MARKERS.items():
            values = np.asarray(getattr(shares, name), float)
            axes.plot(
                values, np.full(len(values), row + apart), marker, color=colour, markersize=4.5, markeredgewidth=0
            )
            if len(values):
                axes.plot([values.mean()] * 2, [row + apart - 0.14, row + apart + 0.14], color=colour, linewidth=2.2)
    axes.set_ylim(len(methods) - 0.1, -0.5)
    low, high = axes.get_xlim()
    axes.set_xlim(min(low, -MARGIN), max(high, 1.0 + MARGIN))
