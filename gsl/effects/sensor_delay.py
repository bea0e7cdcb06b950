"""The encoders report the past: what they measured some time ago is what the servo and the log see."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class SensorDelay:
    """Filters and buses between encoder and servo.

    Signature: the servo overshoots and rings, since it acts on old news, and the log is late on top. Confused with a
    command latency, whose log is as late but does not ring, and with a low kd; a higher kp or kd separates them: an old
    measurement makes the loop unstable, a late command does not.
    """

    kind: ClassVar[str] = "sensor"
    rank: ClassVar[int] = 3

    delay: Annotated[float, setting("age of what the encoders report", unit="s", ge=0, lower=0.0, upper=0.02,
                                    source="estimate; B-Human: 36-42 ms from request to measurement in all",
                                    )]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with older measurements."""
        mask = scope(plant, self.joints)
        return plant.with_servo(sensor_delay=plant.servo.sensor_delay + np.where(mask, self.delay, 0.0))
