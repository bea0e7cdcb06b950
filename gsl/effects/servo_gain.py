"""The servo's gains differ from the nominal ones by a factor."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope

_SOURCE = "estimate: published NAO models differ by more than this"


@component
class ServoGain:
    """Factors on the proportional and the derivative gain.

    Signature: kp changes the static error under load and the rise time, kd the overshoot. Confused with viscous
    friction (kd), gravity, link mass and gain fade (kp); loaded against unloaded holds, a joint without torque, and the
    same pose early and late separate them.
    """

    kind: ClassVar[str] = "servo"
    rank: ClassVar[int] = 1

    kp: Annotated[float, setting("factor on the proportional gain", ge=0, lower=0.3, upper=1.5, source=_SOURCE)] = 1.0
    kd: Annotated[float, setting("factor on the derivative gain", ge=0, lower=0.3, upper=1.5, source=_SOURCE)] = 1.0
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with other gains."""
        mask, servo = scope(plant, self.joints), plant.servo
        return plant.with_servo(kp=servo.kp * np.where(mask, self.kp, 1.0), kd=servo.kd * np.where(mask, self.kd, 1.0))
