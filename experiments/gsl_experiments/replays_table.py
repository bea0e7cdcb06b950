"""The table and the figure of a replay study: how far joints are from the real ones, and how much they yield."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gsl.core.statistics import mean_interval
from gsl.core.unit import Unit
from gsl.report.markdown import table
from gsl.report.run_page import Answer
from gsl.report.style import save
from gsl_experiments.answer import CHOSEN, answer_difference
from gsl_experiments.comparison_table import finely, format_difference
from gsl_experiments.gain_predictors import STANDS
from gsl_experiments.move_and_yield import Shares, move_and_yield_figure
from gsl_experiments.replay import Replay
from gsl_experiments.trial_dots import Dots, trial_dots_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLE, FIGURE = "table.md", "replays.png"
TITLES = (
    *("real world", "grounding", "joints after 0.2 s [°]", "95 % interval", "after a tick [°]"),
    *("pitch [°]", "forward [mm]", "out of reach [%]"),
)
MEANS = {"after_a_tick": ".2f", "pitch": ".2f", "forward": ".1f"}
QUANTITIES = ("stiffness", "strength")
UNKNOWN, SAME = "-", "no gap"
ABOUT = (
    "Stiffness and strength are compliance transferred: 0 as the simulator, 1 as the real robot. "
    "In brackets is the share of the gap that is closed joint by joint, below 0 where it grew; stiffness counts phase. "
    '"no gap" stands where simulator and robot do not differ, "-" where nobody measured. '
    "Stiffness is of a joint whose load swings in the air, strength the load at which it gives way."
)


@dataclass(frozen=True)
class Shown:
    """What a table and a figure show.

    Attributes:
        rows: Of all trials, by trial.
        worlds: Real worlds, in the order of the table.
        colours: Of the methods, by name; the first is what the others are set against.
        groups: Of joints, in the robot's order.
    """

    rows: Sequence[Replay]
    worlds: Sequence[str]
    colours: Mapping[str, str]
    groups: Sequence[str]

    def table(self) -> str:
        """Return the table; trials without compliance have no columns of it."""
        first, measured = next(iter(self.colours)), self._measured
        yielding = [(name, group) for name in QUANTITIES for group in self.groups if group in measured]
        titles = [*TITLES[:4], f"minus {first} (95 %, paired)", *TITLES[4:]]
        titles += [f"{name}, {group} (joint by joint)" for name, group in yielding]
        return table(titles, [self._line(first, *cell, yielding) for cell in product(self.worlds, self.colours)])

    @property
    def answer(self) -> Answer:
        """How much farther from the real joints the best method is than the first, in the first world."""
        world, (first, *others) = self.worlds[0], list(self.colours)
        far = {name: [row.joints for row in self._own(world, name)] for name in self.colours}
        question = "Which grounding makes the simulator's joints move as the real robot's?"
        best = min(others, key=lambda name: np.mean(far[name]), default=first)
        if best == first:
            return Answer(question, f"{first} is {np.mean(far[first]):.2f}° off in {world}.", sure=False)
        apart = mean_interval(np.subtract(far[best], far[first]))
        what = f"In {world}, distance of the joints after 0.2 s, {best} minus {first}"
        return answer_difference(question, what, apart, Unit(name="°"), CHOSEN)

    def about(self) -> list[str]:
        """Return what has to be said of the table."""
        return [ABOUT] if self._measured else []

    def draw(self, path: Path) -> Figure:
        """Write the figure and return it; two panels a world where compliance was measured."""
        moving = {
            world: {
                method: Dots(joints := [row.joints for row in self._own(world, method)], [False] * len(joints), colour)
                for method, colour in self.colours.items()
            }
            for world in self.worlds
        }
        group = STANDS if STANDS in self._measured else next(iter(self._measured), "")
        if not group:
            title = "How far simulators are from real joints, each trial"
            return save(trial_dots_figure(moving, axis=TITLES[2], title=title), path)
        yielding = {
            world: {method: Shares(*self._shares(world, method, group)) for method in self.colours}
            for world in self.worlds
        }
        return save(move_and_yield_figure(moving, yielding, group=group), path)

    @property
    def _measured(self) -> dict[str, None]:
        """Groups of which somebody measured how they yield, in the robot's order."""
        some = {group for row in self.rows for group in row.stiffness or ()}
        return dict.fromkeys([*(group for group in self.groups if group in some), *sorted(some - {*self.groups})])

    def _own(self, world: str, method: str) -> list[Replay]:
        return [row for row in self.rows if (row.world, row.method) == (world, method)]

    def _shares(self, world: str, method: str, group: str) -> list[list[float]]:
        """Return what is closed joint by joint in the trials that have it, by quantity."""
        parts = ([getattr(row, f"{name}_closed") for row in self._own(world, method)] for name in QUANTITIES)
        return [[share for part in own if part is not None and (share := part.get(group)) is not None] for own in parts]

    def _line(self, first: str, world: str, method: str, yielding: Sequence[tuple[str, str]]) -> list[str]:
        own, bare = self._own(world, method), self._own(world, first)
        joints = mean_interval([row.joints for row in own])
        nearer = mean_interval([row.joints - other.joints for row, other in zip(own, bare, strict=True)])
        reach = [100.0 * row.unreached for row in own if row.unreached is not None]
        means = [f"{np.mean([getattr(row, name) for row in own]):{form}}" for name, form in MEANS.items()]
        last = f"{np.mean(reach):.0f}{_few(len(reach), len(own))}" if reach else ""
        than = "" if method == first else format_difference(nearer, fine=True)
        shares = [_share(own, name, group) for name, group in yielding]
        return [world, method, f"{joints.mean:.2f}", finely(joints), than, *means, last, *shares]


def _share(rows: Sequence[Replay], name: str, group: str) -> str:
    """Return the means of a group's share and of what is closed joint by joint."""
    measured = [row for row in rows if getattr(row, name) is not None]
    parts = [[getattr(row, of)[group] for row in measured] for of in (name, f"{name}_closed")]
    shares, closed = ([share for share in part if share is not None] for part in parts)
    if not shares or not closed:
        return SAME if measured else UNKNOWN
    return f"{np.mean(shares):z.2f} ({np.mean(closed):z.2f}){_few(len(measured), len(rows))}"


def _few(some: int, among: int) -> str:
    return f" ({some} of {among} trials)" if 0 < some < among else ""
