"""Compliance transferred, as a study measures it: of a trial's worlds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from gsl.core.impedance import compute_closure
from gsl.core.interfaces import Grounding, World
from gsl.core.seeds import derive_seed
from gsl.grounding.none import NoGrounding
from gsl.validation.compliance import Compliance, measure
from gsl.validation.compliance_transfer import RESOLUTION, SECTION, compute_transfers
from gsl.worlds.bullet import BulletWorld


class Yielding(NamedTuple):
    """Compliance transferred by group of joints, as `Replay` has it."""

    stiffness: Mapping[str, float | None] | None = None
    strength: Mapping[str, float | None] | None = None
    stiffness_closed: Mapping[str, float | None] | None = None
    strength_closed: Mapping[str, float | None] | None = None


def compute_closed_strength(sim: Compliance, grounded: Compliance, real: Compliance, group: str) -> float | None:
    """Return the share of a group's gap in strength that is closed joint by joint; None where there is none."""
    where = sim.where(group)
    before, after, robot = (place.torque[where] for place in (sim, grounded, real))
    return compute_closure(before, after, robot, RESOLUTION * before)


@dataclass(frozen=True)
class Loads:
    """What loads on single joints say of a trial's worlds.

    Attributes:
        sim: The plain simulator.
        seed: Of all randomness.
    """

    sim: World
    seed: int

    def yielding(self, world: World, grounding: Grounding, real: World) -> Yielding:
        """Return what a grounding hands over; nothing where nobody can load the robots.

        Args:
            world: What the grounding has made of the simulator.
            grounding: What is left to do with the actions; ready to act.
            real: The real world.
        """
        if not all(isinstance(place, BulletWorld) for place in (self.sim, world, real)):
            return Yielding()
        start = derive_seed(self.seed, SECTION)  # as optimize and iterate measure it
        sim, robot = (measure(place, NoGrounding(), start) for place in (self.sim, real))
        if sim.motors != robot.motors:
            return Yielding()
        grounded = measure(world, grounding, start)
        shares = compute_transfers(sim, grounded, robot)
        return Yielding(
            {group: share.stiffness for group, share in shares.items()},
            {group: share.torque for group, share in shares.items()},
            {group: share.impedance for group, share in shares.items()},
            {group: compute_closed_strength(sim, grounded, robot, group) for group in shares},
        )
