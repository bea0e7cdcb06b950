"""The centre of mass of a link lies elsewhere than the model says."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import link_named, with_link

_SOURCE = "estimate: 2 cm"


@component
class CentreOfMass:
    """Shifts a link's centre of mass, in the link's axes; its inertia about it stays.

    Signature: a torque that follows the pose and is zero where gravity passes through the joint; on the ground the
    robot leans. Confused with a link's mass, which also resists acceleration, zero offsets, which do not depend on the
    pose, and gravity tilt, which all joints feel; a ladder of static poses and a fast swing separate them.
    """

    kind: ClassVar[str] = "body"
    rank: ClassVar[int] = 6

    link: Annotated[str, setting("name of the link")]
    x: Annotated[float, setting("shift along the link's x", unit="m", lower=-0.02, upper=0.02, source=_SOURCE)] = 0.0
    y: Annotated[float, setting("shift along the link's y", unit="m", lower=-0.02, upper=0.02, source=_SOURCE)] = 0.0
    z: Annotated[float, setting("shift along the link's z", unit="m", lower=-0.02, upper=0.02, source=_SOURCE)] = 0.0

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with the other centre of mass.

        Raises:
            ConfigError: if the robot has no such link.
        """
        link = link_named(plant, self.link)
        return with_link(plant, replace(link, com=link.com + np.array([self.x, self.y, self.z])))
