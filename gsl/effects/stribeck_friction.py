"""Dry friction that is there at low speed only: torque exp(-(v / velocity)²), added to the nominal."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class StribeckFriction:
    """Stiction: what holds a joint at rest and lets go once it moves.

    Signature: it sticks and then jumps at the start of a motion, slow ramps become staircases; at speeds well above
    `velocity` nothing. Confused with Coulomb friction, which lags at every speed, and with backlash and quantisation;
    ramps of 0.01 to 0.1 rad/s beside fast ones separate them.
    """

    kind: ClassVar[str] = "servo"
    rank: ClassVar[int] = 4

    torque: Annotated[float, setting("friction torque at rest", unit="N·m", ge=0, lower=0.0, upper=0.3,
                                     source="Rhoban/bam: 0.01 (XL330) to 0.12 (STS3215)")]  # fmt: skip
    velocity: Annotated[float, setting("speed at which 37 % of it are left", unit="rad/s", gt=0, lower=0.05, upper=0.5,
                                       source="estimate; Rhoban/bam: 0.02-0.08 on STS servos, 2.6 on XL330",
                                       )] = 0.1  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with more stiction; of two the torques add, the velocities are averaged by torque."""
        mask, servo = scope(plant, self.joints), plant.servo
        torque = servo.stribeck + np.where(mask, self.torque, 0.0)
        mean = servo.stribeck * servo.stribeck_velocity + np.where(mask, self.torque * self.velocity, 0.0)
        velocity = np.divide(mean, torque, out=servo.stribeck_velocity.copy(), where=torque > 0.0)
        return plant.with_servo(stribeck=torque, stribeck_velocity=velocity)
