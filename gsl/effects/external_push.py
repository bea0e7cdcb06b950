"""A force from outside on a link's centre of mass, for some time of every episode."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.plant import Plant, Push
from gsl.core.setting import component, setting
from gsl.effects.effect import link_named

_SOURCE = "estimate: a fifth of the weight; π0 falls of 10 N for 0.2 s"


@component
class ExternalPush:
    """Somebody pushes the robot, or a cable pulls at it.

    Signature: a deviation that no command explains, isolated in time, in all joints between the link and the ground.
    Confused with a gravity tilt, if it lasts, and with nothing, if it is short; the same episode without it separates
    them.
    """

    kind: ClassVar[str] = "environment"
    rank: ClassVar[int] = 2

    link: Annotated[str, setting("name of the link")]
    start: Annotated[float, setting("when it begins, from the start of the episode", unit="s", ge=0, lower=0.0,
                                    upper=5.0, source="within an episode")]  # fmt: skip
    duration: Annotated[float, setting("how long it lasts", unit="s", ge=0, lower=0.0, upper=0.5,
                                       source="estimate: a knock to a shove")]  # fmt: skip
    x: Annotated[float, setting("force along the world's x", unit="N", lower=-10.0, upper=10.0, source=_SOURCE)] = 0.0
    y: Annotated[float, setting("force along the world's y", unit="N", lower=-10.0, upper=10.0, source=_SOURCE)] = 0.0
    z: Annotated[float, setting("force along the world's z", unit="N", lower=-10.0, upper=10.0, source=_SOURCE)] = 0.0

    def apply(self, plant: Plant) -> Plant:
        """Return the plant that is pushed, besides the other pushes.

        Raises:
            ConfigError: if the robot has no such link.
        """
        link_named(plant, self.link)
        push = Push(self.link, np.array([self.x, self.y, self.z]), self.start, self.start + self.duration)
        return replace(plant, pushes=(*plant.pushes, push))
