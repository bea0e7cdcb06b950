"""Excite the servos: nothing is wanted of the robot but that it plays what it is given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.interfaces import Step
from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.core.trajectory import Trajectory


@component
class Excite:
    """Every step is worth nothing; an open-loop episode ends when its commands do."""

    unit: ClassVar[str] = ""
    shown: ClassVar[float] = 1.0

    duration: Annotated[float, setting("planned length of an episode", unit="s", gt=0)] = 3.5

    def start(self, layout: Layout, observation: np.ndarray, role: str) -> ExciteRun:
        """Return the task at the beginning of an episode."""
        return ExciteRun()

    def outcome(self, layout: Layout, trajectory: Trajectory) -> Mapping[str, float]:
        """Return nothing: there is nothing to achieve."""
        return {}


class ExciteRun:
    """An excitation in progress."""

    def step(self, before: np.ndarray, after: np.ndarray, fell: bool) -> Step:
        """Reward nothing, end nothing."""
        return Step(0.0, ended=False)
