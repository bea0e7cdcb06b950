"""Jitter: how any two robots of one make differ, which is nobody's fault and no cause."""

from __future__ import annotations

import numpy as np

from gsl.core.plant import Plant

KP, KD = 0.03, 0.05  # relative spreads of the gains
COULOMB = 0.01  # spread of the dry friction, cut off at 0 [N·m]
ZERO = 0.003  # spread of the joints' zeros [rad]
VISCOUS = 0.02  # most of an even spread of viscous friction [N·m·s/rad]
NOISE = (0.001, 0.002)  # least and greatest standard deviation of a robot's encoders [rad]


def jitter(plant: Plant, rng: np.random.Generator) -> Plant:
    """Return another robot of the same make."""
    servo, n = plant.servo, len(plant.robot.motors)
    return plant.with_servo(
        kp=servo.kp * (1.0 + KP * rng.standard_normal(n)),
        kd=servo.kd * (1.0 + KD * rng.standard_normal(n)),
        coulomb=servo.coulomb + np.maximum(0.0, COULOMB * rng.standard_normal(n)),
        offset=servo.offset + ZERO * rng.standard_normal(n),
        viscous=servo.viscous + rng.uniform(0.0, VISCOUS, n),
    )
