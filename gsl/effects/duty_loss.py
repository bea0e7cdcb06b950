"""A share of the driving torque is lost, in proportion to the duty: of more, more."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class DutyLoss:
    """What a driver stage and a saturating motor lose: torque = u (1 - coefficient |u| / limit).

    Signature: under load the error grows faster than the load, large steps are slower, small ones are not. Confused
    with a torque limit, which cuts off at one torque only, and a low kp, whose error is in proportion to the load; a
    ladder of loads separates them.
    """

    kind: ClassVar[str] = "servo"
    rank: ClassVar[int] = 9

    coefficient: Annotated[float, setting("share of the torque lost at the torque limit", ge=0, le=1, lower=0.0,
                                          upper=0.5, source="estimate: gears and drivers lose 0.05-0.5")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with the loss; two add, to the whole torque at most."""
        mask, servo = scope(plant, self.joints), plant.servo
        return plant.with_servo(duty_loss=np.minimum(1.0, servo.duty_loss + np.where(mask, self.coefficient, 0.0)))
