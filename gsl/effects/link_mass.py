"""A link carries more (or less) mass at its centre of mass, its inertia growing in proportion."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.effects.effect import link_named, with_link
from gsl.errors import ConfigError


@component
class LinkMass:
    """Mass that the model does not know: a payload, a battery, a cover.

    Signature: a bias that follows the sine of the pose and grows with reach. Confused with zero offsets, kp, centres of
    mass, armature and load-dependent friction; a ladder of static poses and then a fast swing separate them.
    """

    kind: ClassVar[str] = "body"
    rank: ClassVar[int] = 5

    link: Annotated[str, setting("name of the link")]
    mass: Annotated[float, setting("added mass", unit="kg", lower=0.0, upper=0.5, source="estimate: 10 % of the robot")]

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with the heavier link.

        Raises:
            ConfigError: if the robot has no such link or its mass would not stay positive.
        """
        link = link_named(plant, self.link)
        factor = 1.0 + self.mass / link.mass
        if factor <= 0.0:
            raise ConfigError("mass", f"{self.link} weighs {link.mass} kg: {self.mass} kg more leaves nothing")
        return with_link(plant, replace(link, mass=factor * link.mass, inertia=factor * link.inertia))
