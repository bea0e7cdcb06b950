"""Dry friction at the joint: -torque sign(dq/dt), added to the nominal; it also holds the joint at rest."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class CoulombFriction:
    """Friction of constant size.

    Signature: a lag of constant size with the sign of the speed, flat tops at reversals, a band of static errors of
    +-torque / kp. Confused with backlash, a dead band, stiction and load-dependent friction; triangles at three speeds
    (the error does not depend on speed) and under two loads separate them.
    """

    kind: ClassVar[str] = "servo"
    rank: ClassVar[int] = 2

    torque: Annotated[float, setting("friction torque, below 0 less", unit="N·m", lower=0.0, upper=0.3,
                                     source="HULKs 0.03 on the NAO; Rhoban/bam 0.013-0.104 on Dynamixels")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with more friction, or less, but never below none."""
        mask = scope(plant, self.joints)
        return plant.with_servo(coulomb=np.maximum(0.0, plant.servo.coulomb + np.where(mask, self.torque, 0.0)))
