"""The look of our figures: white, few lines, direct labels, colours that colour-blind readers can tell apart."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

REAL, SIMULATION, GROUNDED = "#d55e00", "#0072b2", "#009e73"  # Okabe and Ito 2008
COMMAND, QUIET, INK = "#8c8c8c", "#d0d0d0", "#222222"
SERVO = "#cc79a7"
UNINFORMED, GAT, SGAT, EFFECTS = COMMAND, SIMULATION, GROUNDED, REAL  # the first know nothing of the real robot
WIDTH, DPI = 10.0, 160  # [in], [1/in]: 1600 pixels
CURVES = 4.6  # height of a figure of curves [in]
NARROW = 0.62  # height of one that is narrower, in shares of its width
EDGE, TICK, PAPER = "#777777", "#555555", "#ffffff"
HUES = ("#222222", "#cc79a7", "#56b4e9", "#e69f00")  # of things without a colour of their own, Okabe and Ito 2008

ROLES = {
    REAL: "real", SIMULATION: "before", GROUNDED: "after", COMMAND: "command", QUIET: "quiet", INK: "ink",
    EDGE: "faint", TICK: "soft", PAPER: "paper",
}  # fmt: skip
"""What colours stand for on a page, which has another one of each in the dark."""
COLOURS: Mapping[str, str] = {role: colour for colour, role in ROLES.items()}
LIGHT = {"line": "#dddddd", "card": "#f6f6f4", "heat": "0, 114, 178", "warn": "#a65a00"}
DARK = {
    "ink": "#e9e9e7", "soft": "#b4b4b2", "faint": "#8b8b8b", "quiet": "#55595f", "paper": "#17191c",
    "real": "#f0803c", "before": "#56b4e9", "after": "#2fbf94", "command": "#9a9a9a",
    "line": "#3a3d42", "card": "#202327", "heat": "40, 140, 210", "warn": "#f0a850",
}  # fmt: skip

_SETTINGS: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 10.5,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": EDGE,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "xtick.color": TICK,
    "ytick.color": TICK,
    "xtick.major.width": 0.8,
    "ytick.major.width": 0.8,
    "text.parse_math": False,
    "figure.facecolor": PAPER,
    "savefig.facecolor": PAPER,
}


def method_colour(name: str) -> str:
    """Return the colour of a method by the first word of its name, the same in all figures."""
    return {"gat": GAT, "sgat": SGAT, "effects": EFFECTS, "ane": QUIET, "servo": SERVO}.get(
        re.split("[ _]", name)[0], UNINFORMED
    )


@contextmanager
def look() -> Iterator[None]:
    """Apply our look to what is drawn inside, and to nothing else."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()  # whatever a file of the user says, equal figures give equal bytes
        matplotlib.rcParams.update(_SETTINGS)
        yield


def figure(height: float, width: float = WIDTH) -> Figure:
    """Return an empty figure [in] that no global list knows of."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=DPI, layout="constrained")


def curve_figure(width: float = WIDTH) -> Figure:
    """Return an empty figure for curves [in]."""
    return figure(CURVES if width == WIDTH else NARROW * width, width)


def label_gap(gap: float, figure: Figure) -> float:
    """Return the least distance of labels in shares of a figure's height, of `gap` in shares of `CURVES`."""
    return gap * CURVES / figure.get_figheight()


def lay_out(figure: Figure) -> None:
    """Give everything its place, once; else each writing begins with a drawing that nobody sees."""
    if (engine := figure.get_layout_engine()) is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)


def save(figure: Figure, path: Path) -> Figure:
    """Write a figure as a PNG file without a date in it, and return it: equal figures give equal bytes."""
    with look():
        lay_out(figure)
        figure.savefig(path, dpi=DPI, metadata={"Software": None})
    return figure


def headline(figure: Figure, text: str) -> None:
    """Write what there is to see above everything, at the left; nothing where a page says it."""
    if not text:
        return
    figure.suptitle(text, x=0.012, ha="left", fontsize=13, fontweight="bold")


def label_ends(axes: Axes, x: float, ends: Sequence[tuple[float, str, str]], *, gap: float) -> None:
    """Write labels to the right of lines that end at `x`, moved apart where they would touch.

    Args:
        axes: With its final limits.
        x: In data units.
        ends: Height in data units, text and colour of each.
        gap: Least distance of two labels, in shares of the axes' height, of which half is kept below the lowest.
            As long as there is room they stay beside the axes.
    """
    low, high = axes.get_ylim()
    order = sorted(range(len(ends)), key=lambda index: ends[index][0])
    places = spread([(ends[index][0] - low) / (high - low) for index in order], gap)
    for index, place in enumerate(places):
        highest = 1.0 - (len(places) - 1 - index) * gap
        places[index] = max(min(place, highest), (0.5 + index) * gap)
    for index, place in zip(order, places, strict=True):
        height, text, colour = ends[index]
        axes.annotate(
            text,
            xy=(x, height),
            xytext=(x + 0.015 * np.ptp(axes.get_xlim()), low + place * (high - low)),
            color=colour,
            va="center",
            ha="left",
            annotation_clip=False,
            linespacing=1.1,
        )


def spread(places: Sequence[float], gap: float) -> list[float]:
    """Return ascending places moved as little as needed to be `gap` apart."""
    moved = list(places)
    for _ in range(100 * len(moved)):
        for index in range(len(moved) - 1):
            lack = gap - (moved[index + 1] - moved[index])
            if lack > 1e-9:
                moved[index] -= lack / 2
                moved[index + 1] += lack / 2
    return moved
