"""The ground gives way: every point of contact is a spring with a damper."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

from gsl.core.plant import Plant
from gsl.core.setting import component, setting


@component
class GroundCompliance:
    """Carpet, turf or foam. The spring is that of one contact point; a flat sole rests on four.

    Signature: standing, the robot is lower by weight / (stiffness x points); touchdown is softer and load passes from
    one foot to the other later, with a bounce where damping is low; nothing in the air. Confused with ground friction
    and uneven ground; stamping on one spot separates them: the force rises slowly, at every place, and nothing slips.
    """

    kind: ClassVar[str] = "contact"
    rank: ClassVar[int] = 2

    stiffness: Annotated[float, setting("force per depth of a contact point", unit="N/m", gt=0, lower=2e3, upper=1e5,
                                        source="estimate: turf to floor; at 1e3 a NAO falls")]  # fmt: skip
    damping: Annotated[float, setting("force per speed of a contact point", unit="N·s/m", ge=0, lower=10.0, upper=300.0,
                                      source="estimate: 0.1 to 2 of the critical damping")] = 100.0  # fmt: skip

    def apply(self, plant: Plant) -> Plant:
        """Return the plant on softer ground; one ground on another is two springs in series, as are their dampers."""
        contact = plant.contact
        if contact.stiffness is None:
            return replace(plant, contact=replace(contact, stiffness=self.stiffness, damping=self.damping))
        stiffness, damping = _series(contact.stiffness, self.stiffness), _series(contact.damping, self.damping)
        return replace(plant, contact=replace(contact, stiffness=stiffness, damping=damping))


def _series(first: float, second: float) -> float:
    return first * second / (first + second) if first + second > 0.0 else 0.0
