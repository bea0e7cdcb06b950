"""A spring in series between motor and output: two masses."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class JointCompliance:
    """Gear, horn and bracket that give way.

    Signature: with the encoder on the motor's side the log shows next to nothing while the limb hangs lower by load ·
    compliance; with the encoder at the output the servo makes up for the load, and a resonance is left: quick motion
    arrives larger than commanded, and with high gains it never comes to rest. Confused with a low kp, backlash and
    kd; a sweep through the resonance, or a load on a joint that something else measures, separates them.
    """

    kind: ClassVar[str] = "body"
    rank: ClassVar[int] = 1

    compliance: Annotated[float, setting("angle per torque", unit="rad/(N·m)", ge=0, lower=0.0, upper=0.03,
                                         source="estimate: 0.002-0.03")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with softer gears; springs in series add."""
        mask = scope(plant, self.joints)
        return plant.with_servo(compliance=plant.servo.compliance + np.where(mask, self.compliance, 0.0))
