"""The torque limit differs from the nominal one by a factor; the speed line stays."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class TorqueLimit:
    """A weak (worn, hot, badly fed) motor.

    Signature: clipped acceleration in large fast steps and under load, nothing in small ones. Confused with supply sag,
    load-dependent friction, duty loss and target smoothing; a ladder of step sizes and of loads, one joint against all
    at once, separate them.
    """

    kind: ClassVar[str] = "servo"
    rank: ClassVar[int] = 7

    factor: Annotated[float, setting("factor on the torque limit", gt=0, lower=0.2, upper=1.2,
                                     source="estimate; a NAO's stiffness scales the current limit")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with another limit."""
        mask = scope(plant, self.joints)
        return plant.with_servo(limit=plant.servo.limit * np.where(mask, self.factor, 1.0))
