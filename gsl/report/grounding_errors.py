"""How far the simulator, grounded or not, is from the real robot after ten ticks of real actions, joint by joint."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gsl.report.style import GROUNDED, QUIET, SIMULATION, WIDTH, figure, headline, look, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Errors = Mapping[str, Mapping[str, float]]
"""Simulator (`ungrounded`, `grounded`, `no_change`) to joint to error [deg]."""

_BARS = (("ungrounded", "simulator", SIMULATION), ("grounded", "grounded simulator", GROUNDED))
_STILL = "no_change"


def grounding_errors(path: Path, groups: Mapping[str, Errors], *, title: str | None = None) -> None:
    """Write the figure of the errors as a PNG file; arguments as those of `grounding_errors_figure`."""
    save(grounding_errors_figure(groups, title=title), path)


def grounding_errors_figure(groups: Mapping[str, Errors], *, title: str | None = None, width: float = WIDTH) -> Figure:
    """Return the figure of the errors.

    Args:
        groups: Trajectories (such as `of π0`), one panel each from above.
        title: By default what grounding does to the RMS error of each group; an empty one is left out.
        width: Of the figure [in].
    """
    with look():
        whole = figure(1.5 + 2.0 * len(groups), width)
        panels = whole.subplots(len(groups), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for axes, (name, errors) in zip(panels, groups.items(), strict=True):
            _draw(axes, errors)
            axes.set_title(f"trajectories {name}", loc="left", fontsize=10.5)
            axes.set_ylabel("error after ten ticks [°]")
        panels[0].set_ylim(0.0, _top(groups))
        if width < WIDTH:
            whole.legend(*panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=3, frameon=False)
        else:
            panels[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.2)
        headline(whole, finding(groups) if title is None else title)
    return whole


def _draw(axes: Axes, errors: Errors) -> None:
    joints = list(next(iter(errors.values())))
    places, width = np.arange(len(joints)), 0.38
    still = [errors[_STILL][joint] for joint in joints]
    axes.bar(places, still, 0.9, color=QUIET, alpha=0.6, label="no change at all")
    for index, (name, label, colour) in enumerate(_BARS):
        values = [errors[name][joint] for joint in joints]
        axes.bar(places + (index - 0.5) * width, values, 0.94 * width, color=colour, label=label)
    axes.set_xticks(places, joints, rotation=35, ha="right", rotation_mode="anchor")
    axes.set_xlim(-0.6, len(joints) - 0.4)
    axes.tick_params(axis="x", length=0)


def _top(groups: Mapping[str, Errors]) -> float:
    """The highest bar of a simulator with room above, though the robot that does not move may be cut off."""
    simulators = [value for errors in groups.values() for name, *_ in _BARS for value in errors[name].values()]
    still = [value for errors in groups.values() for value in errors[_STILL].values()]
    return 1.08 * min(max([*simulators, *still]), 2.5 * max(simulators)) or 1.0


def finding(groups: Mapping[str, Errors]) -> str:
    """Return what grounding does to the RMS error of each group, in a sentence without its full stop."""
    changes = []
    for name, errors in groups.items():
        before, after = (float(np.sqrt(np.mean(np.square(list(errors[bar].values()))))) for bar, *_ in _BARS)
        changes.append(f"from {before:.2f}° to {after:.2f}° {name}")
    return "Grounding takes the joint error " + ", ".join(changes)
