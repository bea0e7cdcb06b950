"""The footfall pattern of walks: when each foot bears load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gsl.report.style import COMMAND, INK, REAL, WIDTH, figure, look

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLOURS = (INK, COMMAND)  # of the feet of a walk, in turn


class Walk(NamedTuple):
    """A walk.

    Attributes:
        label: Whose it is and where.
        time: [s], shape (T,).
        feet: Which foot bears load, by its name, shape (T,) each.
        fell: When the robot fell [s], None if it did not.
    """

    label: str
    time: np.ndarray
    feet: Mapping[str, np.ndarray]
    fell: float | None = None


def footfall_figure(walks: Sequence[Walk], *, width: float = WIDTH) -> Figure:
    """Return the figure: one panel a walk from above, in it one row a foot."""
    with look():
        whole = figure(0.6 + 0.28 * sum(2.2 + len(walk.feet) for walk in walks), width)
        panels = whole.subplots(len(walks), 1, sharex=True, squeeze=False)[:, 0]
        for axes, walk in zip(panels, walks, strict=True):
            for row, (loaded, colour) in enumerate(zip(walk.feet.values(), _COLOURS * len(walk.feet), strict=False)):
                axes.broken_barh(list(_spans(walk.time, loaded)), (row - 0.35, 0.7), color=colour, linewidth=0)
            axes.set_yticks(range(len(walk.feet)), list(walk.feet))
            axes.set_ylim(len(walk.feet) - 0.5, -0.5)
            axes.tick_params(axis="y", length=0)
            axes.set_title(walk.label, loc="left", fontsize=10.5)
            if walk.fell is not None:
                axes.plot([walk.fell], [0.5 * (len(walk.feet) - 1)], "x", color=REAL, markersize=9, markeredgewidth=2.2)
                axes.annotate(" fell", (walk.fell, 0.5 * (len(walk.feet) - 1)), color=REAL, va="center")
        panels[-1].set_xlim(0.0, max(float(walk.time[-1]) for walk in walks))
        panels[-1].set_xlabel("time [s]")
    return whole


def _spans(time: np.ndarray, loaded: np.ndarray) -> list[tuple[float, float]]:
    """Return beginning and length [s] of each time in which a foot bears load."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], loaded.astype(bool), [False]]).astype(int)))
    ends = np.append(time, time[-1])
    return [(float(ends[first]), float(ends[last] - ends[first])) for first, last in edges.reshape(-1, 2)]
