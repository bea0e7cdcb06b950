"""A spring in series between motor and output."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class JointCompliance:
    """Gear, horn and bracket that give way.

    Signature: the limb hangs lower by load · compliance, unseen by an encoder at the motor; an encoder at the output
    shows a resonance. Confused with a low kp, backlash and kd; a sweep through the resonance, or a load on a joint that
    something else measures, separates them.
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
