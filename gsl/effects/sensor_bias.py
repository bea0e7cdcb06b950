"""The log shows joint positions that are off by a constant; neither servo nor robot knows."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class SensorBias:
    """A constant in what the log and the policy see of the positions.

    Signature: the same bias at every speed, load and pose, while the robot moves as if it were not there. Confused with
    a zero offset: in the air the two are alike by nature; on the ground the base and the feet separate them, which a
    bias leaves alone. Also with gravity tilt and masses: poses in which gravity pulls the other way separate them.
    """

    kind: ClassVar[str] = "sensor"
    rank: ClassVar[int] = 1

    bias: Annotated[float, setting("added to the logged positions", unit="rad", lower=-0.07, upper=0.07,
                                   source="estimate: 0.5-4 degrees, as zero_offset")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with another bias in its log."""
        mask, sensors = scope(plant, self.joints), plant.sensors
        return replace(plant, sensors=replace(sensors, bias=sensors.bias + np.where(mask, self.bias, 0.0)))
