"""White noise on the logged joint positions; the servo does not see it."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class EncoderNoise:
    """Gaussian noise on what the log and the policy see of the positions.

    Signature: a white residual that is the same at every horizon. Confused with action noise, which grows with the
    horizon, and quantisation; repeats of one command, and rest, measure it.
    """

    kind: ClassVar[str] = "sensor"
    rank: ClassVar[int] = 2

    sd: Annotated[float, setting("standard deviation", unit="rad", ge=0, lower=0.0, upper=0.003,
                                 source="NAO encoders: 12 bits, 1.5 mrad")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with noisier logs; independent noises add in square."""
        mask, sensors = scope(plant, self.joints), plant.sensors
        noise = np.hypot(sensors.encoder_noise, np.where(mask, self.sd, 0.0))
        return replace(plant, sensors=replace(sensors, encoder_noise=noise))
