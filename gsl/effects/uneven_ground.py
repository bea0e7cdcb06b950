"""The ground is a random surface, another one in every episode."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

from gsl.core.plant import Plant
from gsl.core.setting import component, setting


@component
class UnevenGround:
    """Heights drawn evenly from 0 to `height` at grid points, triangles between them, flat where the robot starts.

    Signature: feet touch down early or late at random, repeats differ in contact and walks drift; nothing in the air.
    Confused with action noise, which also acts in the air, and ground compliance, which is the same at every place;
    repeats on one path and on others separate them.
    """

    kind: ClassVar[str] = "contact"
    rank: ClassVar[int] = 3

    height: Annotated[float, setting("greatest height", unit="m", ge=0, le=0.1, lower=0.0, upper=0.01,
                                     source="our measurement: π0 begins to fall at 0.01")]  # fmt: skip
    spacing: Annotated[float, setting("distance of the grid points", unit="m", ge=0.02, le=1.0, lower=0.05, upper=0.3,
                                      source="estimate: a third of a sole to two soles")] = 0.1  # fmt: skip

    def apply(self, plant: Plant) -> Plant:
        """Return the plant on rougher ground; of two the greater height and the smaller spacing count."""
        before = plant.contact
        spacing = min(before.spacing, self.spacing) if before.roughness > 0.0 else self.spacing
        height = max(before.roughness, self.height)
        return replace(plant, contact=replace(before, roughness=height, spacing=spacing))
