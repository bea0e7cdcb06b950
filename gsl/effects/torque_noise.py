"""Gaussian noise on the torque of every motor: new at each physics step, and a constant drawn once an episode."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class TorqueNoise:
    """Load torques that nobody commanded, whatever the servo does: they deflect a soft joint more than a stiff one.

    Both act beyond the torque limit, as a load does. Campanaro et al. call them random force injection and random
    actuation offset (ERFI, 2209.12878). White noise of another physics period has the same effect at
    `step` · sqrt(2 ms / period).

    Signature: repeats of one command differ by constant / kp at rest, alike all through an episode, and tremble.
    Confused with action noise, which a stiff joint follows as well as a soft one, and with load friction and masses,
    which are the same in every episode; repeats under another gain separate them.
    """

    kind: ClassVar[str] = "servo"
    rank: ClassVar[int] = 11

    step: Annotated[float, setting("standard deviation of what is drawn at every physics step", unit="N·m", ge=0,
                                   lower=0.0, upper=1.0,
                                   source="1 moves a NAO's knee by 1.3 mrad, its encoder's step")] = 0.0  # fmt: skip
    constant: Annotated[float, setting("standard deviation of what is drawn once an episode", unit="N·m", ge=0,
                                       lower=0.0, upper=0.3, source="as much as Coulomb friction")] = 0.0  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with noisier torques; independent noises add in square."""
        mask = scope(plant, self.joints)
        added = np.outer([self.step, self.constant], mask)
        return replace(plant, torque_noise=np.hypot(plant.torque_noise, added))
