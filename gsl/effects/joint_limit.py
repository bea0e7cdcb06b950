"""A hard stop before the end of a joint's range."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import SCOPE, Scope, scope
from gsl.errors import ConfigError


@component
class JointLimit:
    """Cables, covers and worn stops that end a motion earlier than the model says.

    Signature: clipped on one side, at one angle, however slow and with whatever load. Confused with a torque limit,
    which clips large loads at any angle; approaching the stop slowly, from poses with little load, separates them.
    """

    kind: ClassVar[str] = "body"
    rank: ClassVar[int] = 4

    reduction: Annotated[float, setting("how far inwards of the joint's limit the stop is", unit="rad", ge=0, lower=0.0,
                                        upper=0.17, source="estimate: 2-10 degrees")]  # fmt: skip
    side: Annotated[Literal["lower", "upper", "both"], setting("the end of the range that has the stop")] = "both"
    joints: Annotated[Scope, setting(SCOPE)] = "all"

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with the stops; of two the tighter one counts, and a reduction of 0 is none.

        Raises:
            ConfigError: if a joint has no room left between its stops.
        """
        mask, servo = scope(plant, self.joints) & (self.reduction > 0.0), plant.servo
        joints = [plant.robot.joint(name) for name in plant.robot.motors]
        first, last = np.array([(joint.lower + self.reduction, joint.upper - self.reduction) for joint in joints]).T
        lower = np.where(mask & (self.side != "upper"), np.maximum(servo.lower_stop, first), servo.lower_stop)
        upper = np.where(mask & (self.side != "lower"), np.minimum(servo.upper_stop, last), servo.upper_stop)
        if (lower >= upper).any():
            joint = joints[int(np.argmax(lower >= upper))]
            room = f"{joint.name} moves from {joint.lower:.3g} to {joint.upper:.3g} rad"
            raise ConfigError("reduction", f"{room}: its stops leave no room", given=f"{self.reduction:g}")
        return plant.with_servo(lower_stop=lower, upper_stop=upper)
