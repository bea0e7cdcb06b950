"""One joint over time: command, real robot, simulator, grounded simulator (the paper's figures 6 and 7)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gsl.report.shown import DEGREES, Scale
from gsl.report.style import (
    COMMAND,
    GROUNDED,
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
    from matplotlib.figure import Figure


class Traces(NamedTuple):
    """One joint over time, each of shape (T,).

    Attributes:
        time: [s].
        command: Desired position [rad].
        real: Position [rad].
        simulation: Position in the simulator [rad], if there is one.
        grounded: Position in the grounded simulator [rad], if there is one.
        sent: What the grounding sends in place of the command [rad], if that is to be seen.
        name: Of `grounded`, for people.
        scale: How positions are shown.
    """

    time: np.ndarray
    command: np.ndarray
    real: np.ndarray
    simulation: np.ndarray | None = None
    grounded: np.ndarray | None = None
    sent: np.ndarray | None = None
    name: str = "grounded simulation"
    scale: Scale = DEGREES


def joint_trace(path: Path, traces: Traces, joint: str, *, title: str | None = None, rest: int = 0) -> Figure:
    """Write the figure of one joint as a PNG file and return it; arguments as those of `joint_trace_figure`."""
    return save(joint_trace_figure(traces, joint, title=title, rest=rest), path)


def joint_trace_figure(
    traces: Traces, joint: str, *, title: str | None = None, rest: int = 0, width: float = WIDTH
) -> Figure:
    """Return the figure of one joint as people read it; each simulator with its RMS distance from the real robot.

    Args:
        traces: What to draw.
        joint: Its name.
        title: By default what grounding does to that distance; an empty one is left out.
        width: Of the figure [in].
        rest: Ticks in the beginning in which nothing moves, and which no distance is of.
    """
    factor, unit = traces.scale
    distances = []
    lines = [("command", traces.command, COMMAND, 1.3, (0, (5, 3))), ("real", traces.real, REAL, 3.2, "-")]
    simulators = {"simulation": (traces.simulation, SIMULATION), traces.name: (traces.grounded, GROUNDED)}
    for name, (positions, colour) in simulators.items():
        if positions is not None:
            distances.append(_measure(traces.scale, (positions - traces.real)[rest:]))
            lines.append((f"{name},\n{_with_unit(distances[-1], unit)} from real", positions, colour, 1.8, "-"))
    if traces.sent is not None:
        lines.append(("grounded command", traces.sent, GROUNDED, 1.1, (0, (5, 3))))
    with look():
        whole = curve_figure(width)
        axes = whole.subplots()
        for label, angle, colour, width, style in lines:
            axes.plot(traces.time, factor * angle, linestyle=style, color=colour, linewidth=width, label=label)
        axes.set_xlim(traces.time[0], traces.time[-1])
        axes.margins(y=0.08)
        axes.set_xlabel("time [s]")
        axes.set_ylabel(f"{joint} [{unit}]")
        ends = [(factor * float(angle[-1]), label, colour) for label, angle, colour, _, _ in lines]
        label_ends(axes, float(traces.time[-1]), ends, gap=label_gap(0.13, whole))
        headline(
            whole, _finding(joint, [_with_unit(distance, unit) for distance in distances]) if title is None else title
        )
    return whole


def _measure(scale: Scale, difference: np.ndarray) -> float:
    return scale.factor * float(np.sqrt(np.mean(difference**2)))


def _with_unit(distance: float, unit: str) -> str:
    return f"{distance:.1f}{unit}" if unit == DEGREES.unit else f"{distance:.1f} {unit}"


def _finding(joint: str, distances: list[str]) -> str:
    if len(distances) == 1:
        return f"{joint}: the simulator is {distances[0]} from the real robot (RMS)"
    before, after = distances
    return f"{joint}: with grounding {after} from the real robot, without {before} (RMS)"
