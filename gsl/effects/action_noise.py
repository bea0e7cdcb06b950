"""Gaussian noise on the target of every motor, drawn anew at each control step."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class ActionNoise:
    """Targets that arrive a little wrong; also what makes a simulator demand margin of a policy.

    Signature: repeats of one command drift apart, the more the longer they run; what is measured at rest is smooth from
    one step to the next. Confused with encoder noise, which is white and does not grow, and with an uneven ground,
    which needs contact; repeats in the air separate them.
    """

    kind: ClassVar[str] = "command"
    rank: ClassVar[int] = 5

    sd: Annotated[float, setting("standard deviation", unit="rad", ge=0, lower=0.0, upper=0.04,
                                 source="our worlds: 0.02 asks for as much margin as a worn robot")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with noisier targets; independent noises add in square."""
        mask = scope(plant, self.joints)
        return replace(plant, action_noise=np.hypot(plant.action_noise, np.where(mask, self.sd, 0.0)))
