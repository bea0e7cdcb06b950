"""Gravity is turned: first about the world's x axis by `roll`, then about its y axis by `pitch`."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.body import rotation
from gsl.core.plant import Plant
from gsl.core.setting import component, setting

_SOURCE = "estimate: a slope of 15 %"


@component
class GravityTilt:
    """A slope, or a stand that is not upright; with a positive pitch the world's x axis points uphill.

    Signature: the load of every joint changes as one rotation has it; on the ground the robot leans and drifts
    downhill. Confused with zero offsets and centres of mass; turning the robot by half a turn separates them: the
    effect of a slope turns round, theirs does not.
    """

    kind: ClassVar[str] = "environment"
    rank: ClassVar[int] = 1

    roll: Annotated[float, setting("turn about x", unit="rad", lower=-0.15, upper=0.15, source=_SOURCE)] = 0.0
    pitch: Annotated[float, setting("turn about y", unit="rad", lower=-0.15, upper=0.15, source=_SOURCE)] = 0.0

    def apply(self, plant: Plant) -> Plant:
        """Return the plant under turned gravity."""
        x, y = np.eye(3)[:2]
        return replace(plant, gravity=rotation(y, self.pitch) @ rotation(x, self.roll) @ plant.gravity)
