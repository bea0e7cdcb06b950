"""What a task is: reward of each step, planned length, and what a person wants to know of an episode."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np

from gsl.core.layout import Layout
from gsl.core.trajectory import Trajectory

REAL: Literal["real"] = "real"
SIM: Literal["sim"] = "sim"


class Step(NamedTuple):
    """What a task says of one control step; no reward stands for the one that the world itself gives."""

    reward: float | None
    ended: bool


class TaskRun(Protocol):
    """A task in one episode."""

    def step(self, before: np.ndarray, after: np.ndarray, fell: bool) -> Step:
        """Judge the step between two observations."""


class Judged(NamedTuple):
    """What an episode is worth, and what is reported of it, by name with unit."""

    value: float
    outcome: Mapping[str, float]


@runtime_checkable
class ByDistance(Protocol):
    """A task whose value follows from a distance, so that a tape measure will do."""

    def measured(self, distance: float, *, fell: bool) -> Judged:
        """Return what a real episode is worth in which the robot got so far forward [m]."""


@runtime_checkable
class Task(Protocol):
    """What we want of a body.

    Attributes:
        duration: Planned length of an episode [s]; infinite where the world ends it.
        unit: Of a value as people are shown it.
        shown: What a value is multiplied by to be in that unit.

    Where an episode may end in another way than by a fall, `falls: ClassVar[bool] = False` has none reported.
    """

    @property
    def duration(self) -> float:
        """Planned length of an episode [s]."""

    unit: ClassVar[str]
    shown: ClassVar[float]

    def start(self, layout: Layout, observation: np.ndarray, role: str) -> TaskRun:
        """Return the task at the beginning of an episode, in the `real` or in the `sim` world."""

    def outcome(self, layout: Layout, trajectory: Trajectory) -> Mapping[str, float]:
        """Return what is reported of an episode, by name with unit."""
