"""Dry friction in proportion to the load in the gear: coefficient |motor torque - external torque|, added."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class LoadFriction:
    """Gear teeth that are pressed together rub.

    Signature: lifting a weight takes more torque than lowering it, and the difference grows with the weight; a joint
    holding a load stays within about 2 coefficient load / kp of where it would rest without friction. Confused with
    Coulomb friction, a torque limit and kp; poses of different load, each come to from above and from below, separate
    them: the width between them grows with the load, and width and middle together give coefficient and kp.
    """

    kind: ClassVar[str] = "servo"
    rank: ClassVar[int] = 5

    coefficient: Annotated[float, setting("friction torque per torque in the gear", ge=0, lower=0.0, upper=0.4,
                                          source="Rhoban/bam: XL330 0.07-0.29, STS3215 0.05-0.30")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with gears that rub more."""
        mask = scope(plant, self.joints)
        return plant.with_servo(load_friction=plant.servo.load_friction + np.where(mask, self.coefficient, 0.0))
