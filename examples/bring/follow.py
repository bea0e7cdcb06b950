"""A pendulum on a servo is to follow a mark that swings; an episode ends when it has lost the mark."""

import math
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.interfaces import Step
from gsl.core.setting import component, setting


@component
class Follow:
    """Rewards every step that the joint is near the mark; whoever loses it gets nothing more."""

    duration: Annotated[float, setting("planned length of an episode", unit="s", gt=0)] = 3.0
    angle: Annotated[float, setting("that the mark swings to, from 0 and back", unit="rad")] = 1.0
    frequency: Annotated[float, setting("of the mark", unit="Hz", gt=0)] = 1.0
    width: Annotated[float, setting("error at which a step is worth half of one at the mark", unit="rad", gt=0)] = 0.1
    lost: Annotated[float, setting("error at which the mark is lost", unit="rad", gt=0)] = 0.3

    unit: ClassVar[str] = "steps at the mark"
    shown: ClassVar[float] = 1.0
    falls: ClassVar[bool] = False  # an episode that ends early is no fall

    def mark(self, time):
        """Return the angle of the mark [rad]."""
        return 0.5 * self.angle * (1.0 - np.cos(2.0 * math.pi * self.frequency * time))

    def start(self, layout, observation, role):
        return Run(self, layout.control_period)

    def outcome(self, layout, trajectory):
        period = layout.control_period
        errors = trajectory.position[1:, 0] - self.mark(period * np.arange(1, len(trajectory) + 1))
        return {"error [rad]": float(np.abs(errors).mean()), "kept to the end": float(abs(errors[-1]) < self.lost)}


class Run:
    """The task in one episode."""

    def __init__(self, task, period):
        self.task, self.period, self.time = task, period, 0.0

    def step(self, before, after, fell):
        self.time += self.period
        error = abs(after[0] - self.task.mark(self.time))
        return Step(1.0 / (1.0 + (error / self.task.width) ** 2), ended=bool(error > self.task.lost))
