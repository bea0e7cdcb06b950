"""The proportional gain fades in the course of an episode: kp (1 - rate · t)."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class GainFade:
    """Motors that get hot, and firmware that spares them.

    Signature: the same pose under the same load is held worse and worse; the error grows with time and is back at the
    next episode. Confused with a low kp, which is there from the start, and a drifting zero, which does not depend on
    the load; returning to one pose again and again, and a rest, separate them.
    """

    kind: ClassVar[str] = "servo"
    rank: ClassVar[int] = 10

    rate: Annotated[float, setting("share of kp lost in a second", unit="1/s", ge=0, lower=0.0, upper=0.02,
                                   source="estimate: 0.0005 while warming, then quicker")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with a gain that fades faster."""
        mask = scope(plant, self.joints)
        return plant.with_servo(fade=plant.servo.fade + np.where(mask, self.rate, 0.0))
