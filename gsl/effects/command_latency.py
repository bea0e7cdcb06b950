"""The target arrives later: target(t) = command(t - delay), continuous in the delay."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class CommandLatency:
    """Time between issuing a command and the servo's seeing it.

    Signature: a pure time shift, error in proportion to speed, zero at rest. Confused with target smoothing, viscous
    friction and a higher kd in slow motion; steps of several sizes separate them: the onset is late, the slope as
    ever. Also with a sensor delay, which in open loop shifts the log as much; a higher kp makes that one ring.
    """

    kind: ClassVar[str] = "command"
    rank: ClassVar[int] = 1

    delay: Annotated[float, setting("how much later the target arrives", unit="s", ge=0, le=0.3, lower=0.0, upper=0.05,
                                    source="B-Human: 36-42 ms on a NAO, request to measurement")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with later targets."""
        mask = scope(plant, self.joints)
        return plant.with_servo(delay=plant.servo.delay + np.where(mask, self.delay, 0.0))
