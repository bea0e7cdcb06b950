"""Walk forward fast without falling (the paper's sections 6.4 and 6.5)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.interfaces import REAL, Judged, Step
from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.core.trajectory import Trajectory

EXACT = 2.0**40  # rewards are multiples of its inverse, so that taking all of them back leaves exactly 0


@component
class Walk:
    """The value is the mean forward speed over the planned time [m/s]; a fall is paid for.

    In the real world an episode with a fall is worth 0; in simulation it keeps the distance and pays the fall cost.
    """

    unit: ClassVar[str] = "cm/s"
    shown: ClassVar[float] = 100.0

    duration: Annotated[float, setting("planned length of an episode", unit="s", gt=0)] = 7.5
    fall_cost: Annotated[float, setting("price of a fall in simulation", unit="m/s", ge=0)] = 0.15

    def start(self, layout: Layout, observation: np.ndarray, role: str) -> WalkRun:
        """Return the task at the beginning of an episode."""
        return WalkRun(self, layout["base.position"].start, real=role == REAL)

    def outcome(self, layout: Layout, trajectory: Trajectory) -> Mapping[str, float]:
        """Return the mean forward speed over the planned time, the fall notwithstanding."""
        x = trajectory.sensors["base.position.x"]
        return self._report(float(x[-1] - x[0]))

    def judge_distance(self, distance: float, *, fell: bool) -> Judged:
        """Return what a real walk over a distance [m] is worth."""
        return Judged(0.0 if fell else distance / self.duration, self._report(distance))

    def _report(self, distance: float) -> Mapping[str, float]:
        return {"speed [cm/s]": 100.0 * distance / self.duration}


class WalkRun:
    """A walk in progress."""

    def __init__(self, task: Walk, forward: int, *, real: bool) -> None:
        self._task, self._forward, self._real, self._so_far = task, forward, real, 0.0

    def step(self, before: np.ndarray, after: np.ndarray, fell: bool) -> Step:
        """Pay the distance of the step; at a fall take back everything (real) or the fall cost (simulation)."""
        reward = round(float(after[self._forward] - before[self._forward]) / self._task.duration * EXACT) / EXACT
        if fell:
            reward = -self._so_far if self._real else reward - self._task.fall_cost
        self._so_far += reward
        return Step(reward, ended=False)
