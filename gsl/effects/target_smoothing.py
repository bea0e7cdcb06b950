"""The servo filters its target: a first-order lag behind its command."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class TargetSmoothing:
    """A filter in the servo's firmware, or a profile that resembles one.

    Signature: a step sets off at once but rounded, 63 % of the way after the time constant; quick motion arrives
    smaller and later; nothing at rest. Confused with a command latency, a higher kd and viscous friction, since a slow
    motion is merely late; the onset of a step separates it from a latency, steps of several sizes from a torque limit,
    another load from the servo's own dynamics.
    """

    kind: ClassVar[str] = "command"
    rank: ClassVar[int] = 2

    time_constant: Annotated[float, setting("time in which 63 % of a step are passed on", unit="s", ge=0, lower=0.0,
                                            upper=0.05, source="estimate; hobby servos smooth targets so (Rhoban/bam)",
                                            )]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with smoother targets; the time constants of two filters add."""
        mask = scope(plant, self.joints)
        return plant.with_servo(smoothing=plant.servo.smoothing + np.where(mask, self.time_constant, 0.0))
