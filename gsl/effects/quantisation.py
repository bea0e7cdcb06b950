"""The servo rounds its target to a multiple of a step."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class Quantisation:
    """A target of few bits.

    Signature: a slow motion is a staircase of this step, and a target rests up to half a step off; nothing else.
    Confused with stiction, whose jumps have no common grid, and with encoder noise, which also shows at rest; ramps
    slower than a step in a second separate them.
    """

    kind: ClassVar[str] = "command"
    rank: ClassVar[int] = 4

    step: Annotated[float, setting("what targets are rounded to", unit="rad", ge=0, lower=0.0, upper=0.01,
                                   source="12 bits a turn are 0.0015 (NAO, STS3215), XL320: 0.0051")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with coarser targets; of two steps the larger one counts."""
        mask = scope(plant, self.joints)
        return plant.with_servo(quantum=np.maximum(plant.servo.quantum, np.where(mask, self.step, 0.0)))
