"""Friction in proportion to speed: -coefficient dq/dt, added to the nominal."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class ViscousFriction:
    """Drag of the grease, and of a motor's back-EMF where the servo does not make up for it.

    Signature: a lag in proportion to speed, zero at rest, and a free fall that slows down. Confused with kd, which does
    the same while the servo is on, and with a command latency in slow motion; a joint whose torque is switched off, or
    a step against its onset, separates them.
    """

    kind: ClassVar[str] = "servo"
    rank: ClassVar[int] = 3

    coefficient: Annotated[float, setting("torque per speed, below 0 less", unit="N·m·s/rad", lower=0.0, upper=1.1,
                                          source="HULKs' NAO model 1.08; Rhoban/bam 0.004-0.08 without back-EMF",
                                          )]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with more drag, or less, but never below none."""
        mask = scope(plant, self.joints)
        return plant.with_servo(viscous=np.maximum(0.0, plant.servo.viscous + np.where(mask, self.coefficient, 0.0)))
