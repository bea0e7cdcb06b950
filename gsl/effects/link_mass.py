"""A link carries more (or less) mass at its centre of mass, its inertia growing in proportion."""

from __future__ import annotations

import difflib
from dataclasses import replace
from typing import Annotated, ClassVar

from gsl.core.plant import Plant
from gsl.core.setting import component, setting
from gsl.errors import ConfigError


@component
class LinkMass:
    """Mass that the model does not know: a payload, a battery, a cover.

    Signature: a bias that follows the sine of the pose and grows with reach. Confused with zero offsets, kp and
    load-dependent friction; a ladder of static poses tells them apart.
    """

    kind: ClassVar[str] = "body"
    rank: ClassVar[int] = 1

    link: Annotated[str, setting("name of the link")]
    mass: Annotated[float, setting("added mass", unit="kg", lower=0.0, upper=0.5, source="estimate: 10 % of the robot")]

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with the heavier link.

        Raises:
            ConfigError: if the robot has no such link or its mass would not stay positive.
        """
        links = dict(plant.robot.links)
        if self.link not in links:
            near = difflib.get_close_matches(self.link, links, 1) or [", ".join(links)]
            raise ConfigError("link", f"the {plant.robot.name} has no link '{self.link}'; did you mean {near[0]}?")
        link = links[self.link]
        factor = 1.0 + self.mass / link.mass
        if factor <= 0.0:
            raise ConfigError("mass", f"{self.link} weighs {link.mass} kg: {self.mass} kg more leaves nothing")
        links[self.link] = replace(link, mass=factor * link.mass, inertia=factor * link.inertia)
        return replace(plant, robot=replace(plant.robot, links=links))
