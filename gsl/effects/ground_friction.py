"""The friction coefficient between sole and ground is another one."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

from gsl.core.plant import Plant
from gsl.core.setting import component, setting


@component
class GroundFriction:
    """Coefficient of friction under the feet.

    Signature: slip of the stance foot, drift in yaw; nothing in the air and nothing while standing. Confused with
    ground compliance and uneven ground; a ladder of push-offs separates them: it slips beyond one size.
    """

    kind: ClassVar[str] = "contact"
    rank: ClassVar[int] = 1

    friction: Annotated[float, setting("coefficient between sole and ground", ge=0, lower=0.2, upper=1.2,
                                       source="estimate: hard floor to carpet")]  # fmt: skip

    def apply(self, plant: Plant) -> Plant:
        """Return the plant on another ground; Bullet multiplies the coefficients of the two bodies."""
        ground = self.friction / plant.contact.foot_friction
        return replace(plant, contact=replace(plant.contact, ground_friction=ground))
