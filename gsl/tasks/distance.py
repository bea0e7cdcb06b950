"""Get forward within a time, judged at the end alone (the paper's section 6.3)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.interfaces import REAL, Judged, Step
from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.core.trajectory import Trajectory


@component
class Distance:
    """The value is the distance forward [m]: in simulation less a penalty for a fall, in the real world 0 after one."""

    unit: ClassVar[str] = "cm"
    shown: ClassVar[float] = 100.0

    duration: Annotated[float, setting("planned length of an episode", unit="s", gt=0)] = 5.0
    fall_cost: Annotated[float, setting("price of a fall in simulation", unit="m", ge=0)] = 0.25

    def start(self, layout: Layout, observation: np.ndarray, role: str) -> DistanceRun:
        """Return the task at the beginning of an episode."""
        forward = layout["base.position"].start
        last = round(self.duration / layout.control_period)
        return DistanceRun(self, forward, float(observation[forward]), last, real=role == REAL)

    def outcome(self, layout: Layout, trajectory: Trajectory) -> Mapping[str, float]:
        """Return the distance, a fall notwithstanding."""
        x = trajectory.sensors["base.position.x"]
        return self._report(float(x[-1] - x[0]))

    def judge_distance(self, distance: float, *, fell: bool) -> Judged:
        """Return what a distance [m] is worth in the real world."""
        return Judged(0.0 if fell else distance, self._report(distance))

    def _report(self, distance: float) -> Mapping[str, float]:
        return {"distance [cm]": 100.0 * distance}


class DistanceRun:
    """A walk in progress."""

    def __init__(self, task: Distance, forward: int, begin: float, last: int, *, real: bool) -> None:
        self._task, self._forward, self._begin, self._left, self._real = task, forward, begin, last, real

    def step(self, before: np.ndarray, after: np.ndarray, fell: bool) -> Step:
        """Pay at the end of the episode, or at a fall."""
        self._left -= 1
        if self._left > 0 and not fell:
            return Step(0.0, ended=False)
        distance = float(after[self._forward]) - self._begin
        if fell:
            distance = 0.0 if self._real else distance - self._task.fall_cost
        return Step(distance, ended=False)
