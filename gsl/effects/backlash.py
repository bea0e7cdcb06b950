"""Play between motor and output: two masses, and teeth that push only when the gap is closed."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class Backlash:
    """Free play of the gear; the encoder sits at the output.

    Signature: a hysteresis of constant width where the load reverses, lost motion and then a jerk, limit cycles near 13
    Hz at rest. Confused with Coulomb friction, a dead band and joint compliance; a slow triangle under a load bias
    closes the gap: the backlash vanishes, friction, dead band and spring stay.
    """

    kind: ClassVar[str] = "servo"
    rank: ClassVar[int] = 6

    width: Annotated[float, setting("full width of the play", unit="rad", ge=0, lower=0.0, upper=0.03,
                                    source="Webots DARwIn-OP 0.01; worn NAOs reach 0.09-0.14 (B-Human)")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with wider play."""
        mask = scope(plant, self.joints)
        return plant.with_servo(play=plant.servo.play + np.where(mask, self.width, 0.0))
