"""Raise both arms to 45 degrees and hold them there (the paper's section 6.2)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.interfaces import Step
from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.core.trajectory import Trajectory

JOINTS = ("LShoulderPitch", "RShoulderPitch")
HANGING = 0.5 * math.pi  # shoulder pitch of an arm that hangs down [rad]


@component
class Arm:
    """Reward 1 / |x - x*|², x in degrees of lift, capped within `cap` of the goal.

    An arm above the goal ends the episode, and that step is worth nothing: else a jump across the goal pays as much as
    most ways of stopping below it, and a search stays there.
    """

    unit: ClassVar[str] = "sum of rewards"
    shown: ClassVar[float] = 1.0

    duration: Annotated[float, setting("planned length of an episode", unit="s", gt=0)] = 4.0
    goal: Annotated[float, setting("lift to reach and not to exceed", unit="rad", gt=0)] = math.pi / 4
    cap: Annotated[float, setting("distance below which the reward grows no more", unit="rad", gt=0)] = math.pi / 180

    def start(self, layout: Layout, observation: np.ndarray, role: str) -> ArmRun:
        """Return the task at the beginning of an episode."""
        first = layout["position"].start
        return ArmRun(self, [first + layout.joints.index(name) for name in JOINTS])

    def outcome(self, layout: Layout, trajectory: Trajectory) -> Mapping[str, float]:
        """Return the distance to the goal, at the end and on average, and whether an arm went above it."""
        shoulders = trajectory.position[:, [layout.joints.index(name) for name in JOINTS]]
        far = [math.degrees(self.distance(angles)) for angles in shoulders]
        above = bool((HANGING - shoulders[-1] > self.goal).any())
        return {"distance [deg]": far[-1], "mean distance [deg]": float(np.mean(far)), "above [share]": float(above)}

    def distance(self, shoulders: np.ndarray) -> float:
        """Return |x - x*| of two shoulder pitches [rad]."""
        return float(np.linalg.norm(HANGING - shoulders - self.goal))


class ArmRun:
    """An arm movement in progress."""

    def __init__(self, task: Arm, entries: list[int]) -> None:
        self._task, self._entries = task, entries

    def step(self, before: np.ndarray, after: np.ndarray, fell: bool) -> Step:
        """Reward closeness after the step."""
        shoulders = after[self._entries]
        above = bool((HANGING - shoulders > self._task.goal).any())
        closest = max(self._task.distance(shoulders), self._task.cap)
        return Step(0.0 if above else 1.0 / math.degrees(closest) ** 2, ended=above)
