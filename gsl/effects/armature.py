"""More rotor inertia, as the joint's output feels it, than the nominal."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class Armature:
    """A heavier rotor, or another gear ratio.

    Signature: slower to set off and more overshoot; nothing at rest and in slow motion. Confused with a torque limit in
    large steps, kd, and a payload, which also weighs; steps of several sizes, and the same with a weight, separate
    them.
    """

    kind: ClassVar[str] = "body"
    rank: ClassVar[int] = 2

    inertia: Annotated[float, setting("added inertia", unit="kg·m²", lower=0.0, upper=0.05,
                                      source="HULKs' NAO model: 0.045 in all; ours: 0.002-0.016")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with heavier rotors."""
        mask = scope(plant, self.joints)
        return plant.with_servo(armature=plant.servo.armature + np.where(mask, self.inertia, 0.0))
