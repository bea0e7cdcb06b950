"""The servo ignores small errors, and of larger ones the same amount: a dead band without a jump."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class Deadband:
    """A dead zone in the servo's control law.

    Signature: a joint without load stops anywhere within +-width of its target, steps smaller than that move nothing,
    and a loaded joint hangs lower by width. Confused with backlash, dry friction and a low kp; a ladder of static loads
    separates it: the error grows by load / kp from width on, whereas friction's depends on where the joint came from
    and kp's goes through zero.
    """

    kind: ClassVar[str] = "command"
    rank: ClassVar[int] = 3

    width: Annotated[float, setting("half width of the errors that are ignored", unit="rad", ge=0, lower=0.0,
                                    upper=0.03, source="estimate; STS3215 sets 0-32 ticks, 0.05")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with a wider dead band; one behind another adds up."""
        mask = scope(plant, self.joints)
        return plant.with_servo(deadband=plant.servo.deadband + np.where(mask, self.width, 0.0))
