"""The strip below a film: the command and the position of the joint that moves most, over the time of the film."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np

from gsl.report.shown import scale_of
from gsl.report.style import COMMAND, look

HEIGHT, DPI = 130, 100  # [pixels], [1/in]
LEFT, RIGHT, NARROW = 48, 200, 600  # margins; a film without room for a legend [pixels]
LETTER, TIME = 8.0, 100  # widths of a letter, the most, and of what else is on the line of a joint's name [pixels]


def draw_traces(
    joints: Sequence[str], shots: Sequence[Any], width: int, slides: Collection[str] = ()
) -> tuple[np.ndarray, Callable[[float], float]]:
    """Return a picture of the traces, shape (HEIGHT, width, 3) of uint8, and the column [pixels] of a time [s].

    Args:
        joints: Names of the columns of positions.
        shots: What is shown in the film; a command that differs from that of the first is drawn as well.
        width: [pixels].
        slides: Names of the joints that slide.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    first = shots[0].trajectory
    scales = [scale_of(name, slides) for name in joints]
    ways = np.ptp(first.position, axis=0) * [scale.factor for scale in scales]
    joint = int(np.argmax(ways))
    factor, unit = scales[joint]
    with look():
        figure = Figure(figsize=(width / DPI, HEIGHT / DPI), dpi=DPI)
        canvas = FigureCanvasAgg(figure)
        labelled = width > NARROW
        right = width - (RIGHT if labelled else LEFT / 2)
        axes = figure.add_axes((LEFT / width, 0.28, (right - LEFT) / width, 0.64))
        asked = factor * first.action[:, joint]
        axes.plot(first.time[:-1], asked, "--", color=COMMAND, linewidth=1.0, label="command")
        for shot in shots:
            way = factor * shot.trajectory.position[:, joint]
            axes.plot(shot.trajectory.time, way, color=shot.colour, linewidth=1.4, label=shot.where or shot.who)
            own = factor * shot.trajectory.action[:, joint]
            if not np.array_equal(own, asked):
                axes.plot(shot.trajectory.time[:-1], own, ":", color=shot.colour, linewidth=1.0, label="its command")
        axes.set_xlim(0.0, max(float(shot.trajectory.time[-1]) for shot in shots))
        title = f"{shorten(joints[joint], (right - LEFT - TIME) / LETTER)} [{unit}]"
        figure.text(LEFT / width, 0.03, title, fontsize=8)  # upright it would not fit beside so low a picture
        axes.tick_params(labelsize=8)
        figure.text(right / width, 0.03, "time [s]", fontsize=8, ha="right")
        if labelled:
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False)
        canvas.draw()  # type: ignore[no-untyped-call]
    picture = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
    picture = picture[..., :3].copy()
    return picture, lambda moment: float(axes.transData.transform((moment, 0.0))[0])


def shorten(name: str, most: float) -> str:
    """Return a name of `most` letters, without its middle if it is longer: both of its ends tell joints apart."""
    half = max(2, (int(most) - 1) // 2)
    return name if len(name) <= most else f"{name[:half]}…{name[-half:]}"
