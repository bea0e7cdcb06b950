"""A pendulum on a servo is to get to a mark and stay there; a policy is worth the steps that it is there."""

from typing import Annotated, ClassVar

from gsl.core.interfaces import Step
from gsl.core.setting import component, setting


@component
class Mark:
    """Rewards every step that the joint is near the mark, less for a fast joint."""

    duration: Annotated[float, setting("planned length of an episode", unit="s", gt=0)] = 1.0
    angle: Annotated[float, setting("of the mark", unit="rad")] = 1.0
    width: Annotated[float, setting("error at which a step is worth half of one at the mark", unit="rad", gt=0)] = 0.05

    unit: ClassVar[str] = "steps at the mark"
    shown: ClassVar[float] = 1.0
    falls: ClassVar[bool] = False

    def start(self, layout, observation, role):
        return Run(self)

    def outcome(self, layout, trajectory):
        return {"last error [rad]": float(trajectory.position[-1, 0] - self.angle)}


class Run:
    """The task in one episode."""

    def __init__(self, task):
        self.task = task

    def step(self, before, after, fell):
        error = (after[0] - self.task.angle) / self.task.width
        return Step(1.0 / (1.0 + error**2), ended=False)
