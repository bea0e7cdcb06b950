"""A joint's zero is off: it goes to target + offset, and the log shows it."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope


@component
class ZeroOffset:
    """A joint that was calibrated wrongly, in the servo: it stands elsewhere than commanded.

    Signature: the same bias at every speed, load and pose; on the ground the base leans. Confused with a sensor bias:
    in the air the two are alike by nature (the log shows both, but only this one moves the robot), on the ground the
    base and the feet separate them. Also with gravity tilt and masses: poses in which gravity pulls the other way
    separate them.
    """

    kind: ClassVar[str] = "body"
    rank: ClassVar[int] = 3

    offset: Annotated[float, setting("added to the target", unit="rad", lower=-0.07, upper=0.07,
                                     source="estimate: 0.5-4 degrees")]  # fmt: skip
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with another zero."""
        mask = scope(plant, self.joints)
        return plant.with_servo(offset=plant.servo.offset + np.where(mask, self.offset, 0.0))
