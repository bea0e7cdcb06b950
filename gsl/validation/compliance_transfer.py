"""Compliance transferred: how much of the gap in stiffness and strength a grounding hands over, by group of joints."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gsl.core.console import Console
from gsl.core.impedance import QUANTITIES, compute_closure, compute_transfer
from gsl.core.interfaces import Grounding, World
from gsl.core.seeds import derive_seed
from gsl.grounding.ane import ActionNoise
from gsl.grounding.none import NoGrounding
from gsl.storage.documents import write_json
from gsl.validation.compliance import Compliance, measure
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.ensemble import EnsembleWorld

SECTION = "compliance"  # of the grounding's report and of metrics
RESOLUTION = 0.02  # share below which two measured values are the same: a bristle's spring adds as much
SURELY = 2.0  # standard errors
SIM, GROUNDED, REAL = "sim", "grounded", "real"
TITLE = "loads on single joints in the air"
NOTHING = "no difference"


class Share(NamedTuple):
    """How much of a gap is handed over in a group of joints; None where simulator and robot do not differ.

    Attributes:
        stiffness: (K_sim - K_grounded) / (K_sim - K_real).
        impedance: Share of the gap in stiffness and damping together that is closed joint by joint, below 0 if it grew.
        torque: As `stiffness`, of the load at which a joint gives way.
    """

    stiffness: float | None
    impedance: float | None
    torque: float | None


def compute_transfers(sim: Compliance, grounded: Compliance, real: Compliance) -> Mapping[str, Share]:
    """Return what a grounding hands over, by group of joints."""
    noise = SURELY * np.hypot(sim.noise, real.noise)
    stiff, strong = np.fmax(noise, RESOLUTION * np.abs(sim.impedance)), RESOLUTION * sim.torque
    shares = {}
    for group in sim.groups:
        motors = sim.where(group)
        shares[group] = Share(
            compute_transfer(sim.stiffness[motors], grounded.stiffness[motors], real.stiffness[motors], stiff[motors]),
            compute_closure(sim.impedance[motors], grounded.impedance[motors], real.impedance[motors], stiff[motors]),
            compute_transfer(sim.torque[motors], grounded.torque[motors], real.torque[motors], strong[motors]),
        )
    return shares


@dataclass(frozen=True)
class ComplianceReport:
    """The simulator without and with a grounding, and the real robot where somebody can load it.

    Attributes:
        sim, grounded, real: What was measured.
    """

    sim: Compliance
    grounded: Compliance
    real: Compliance | None = None

    @property
    def shares(self) -> Mapping[str, Share]:
        """By group; nothing without a real robot."""
        return {} if self.real is None else compute_transfers(self.sim, self.grounded, self.real)

    @property
    def titles(self) -> tuple[str, ...]:
        """Of the rows."""
        return ("joints", "", "simulator", GROUNDED, *(("real", "handed over") if self.real else ()))

    def rows(self) -> list[tuple[str, ...]]:
        """Return a table for people."""
        return [
            (group, title, *(f"{value:.3g}" for value in means.values()), *self._format_shares(group, quantity))
            for group, quantities in self.means().items()
            for (quantity, title), means in zip(QUANTITIES.items(), quantities.values(), strict=True)
        ]

    @property
    def sentence(self) -> str:
        """What a person should know of it, in a sentence or two."""
        if self.real is None:
            same = "Where the grounded joints are as stiff as the simulator's, only their motion was grounded."
            return f"{same} Whether a robot falls depends on its stiffness as well."
        parts = [
            f"{group}: stiffness {self._describe(group, 'stiffness')}, strength {self._describe(group, 'torque')}"
            for group in self.sim.groups
        ]
        scale = "0 as the simulator, 1 as the robot, above 1 changed by more than the robot differs"
        return f"Compliance transferred, {scale}: {'; '.join(parts)}."

    def means(self) -> dict[str, dict[str, dict[str, float]]]:
        """Return the mean over each group's joints, by group, quantity and robot."""
        robots = {SIM: self.sim, GROUNDED: self.grounded, **({REAL: self.real} if self.real else {})}
        return {
            group: {
                quantity: {
                    name: float(getattr(compliance, quantity)[compliance.where(group)].mean())
                    for name, compliance in robots.items()
                }
                for quantity in QUANTITIES
            }
            for group in self.sim.groups
        }

    def metrics(self) -> dict[str, Any]:
        """Return means and shares by group."""
        return {
            group: {**quantities, **({"share": self.shares[group]._asdict()} if self.real else {})}
            for group, quantities in self.means().items()
        }

    def document(self) -> dict[str, Any]:
        """Return everything as a JSON document."""
        robots = {SIM: self.sim, GROUNDED: self.grounded, **({REAL: self.real} if self.real else {})}
        return {
            "groups": self.metrics(),
            "by_motor": {name: compliance.document() for name, compliance in robots.items()},
        }

    def _format_shares(self, group: str, quantity: str) -> tuple[str, ...]:
        if self.real is None:
            return ()
        return ("",) if quantity == "damping" else (self._describe(group, quantity),)

    def _describe(self, group: str, quantity: str) -> str:
        """Return a share in words; where there was nothing to hand over, how far the grounding strays."""
        share = self.shares[group]
        if (value := getattr(share, quantity)) is not None:
            joined = share.impedance if quantity == "stiffness" else None
            return f"{value:.2f}" if joined is None else f"{value:.2f} ({joined:.2f} with phase, joint by joint)"
        means = self.means()[group][quantity]
        strays = means[GROUNDED] / means[SIM] - 1.0
        return (
            NOTHING if abs(strays) < RESOLUTION else f"{NOTHING}, yet the grounding changes it by {100 * strays:+.0f} %"
        )


def report_compliance(
    plain: World, world: World, grounding: Grounding, report: Path, console: Console, seed: int
) -> Mapping[str, Any]:
    """Measure what a grounding makes of a simulator, add it to its report and show it; return it as metrics.

    Args:
        plain: The simulator.
        world: What the grounding has made of it; of an ensemble what it is drawn around.
        grounding: What is left to do with the actions; ready to act.
        report: File to which it is added.
        console: Where it is shown.
        seed: Of all randomness.
    """
    world = world.world if isinstance(world, EnsembleWorld) else world
    nothing = isinstance(grounding, NoGrounding | ActionNoise) and world == plain
    if nothing or not (isinstance(plain, BulletWorld) and isinstance(world, BulletWorld)) or plain.motors != "servo":
        return {}  # the engine's own motors bear any load below their limit
    console.phase("loading single joints in the air, without and with the grounding")
    start = derive_seed(seed, SECTION)
    transfer = ComplianceReport(measure(plain, NoGrounding(), start), measure(world, grounding, start))
    before = json.loads(report.read_text(encoding="utf-8")) if report.exists() else {}
    write_json(report, {**before, SECTION: transfer.document()})
    console.table(TITLE, transfer.titles, transfer.rows(), transfer.sentence)
    return {SECTION: transfer.metrics()}


def with_real(report: Path, real: World, seed: int) -> ComplianceReport | None:
    """Return a report with the real robot beside it; None if nothing was measured, or nobody can load the robot."""
    document = json.loads(report.read_text(encoding="utf-8")) if report.exists() else {}
    if SECTION not in document or not isinstance(real, BulletWorld) or real.motors != "servo":
        return None
    by_motor = document[SECTION]["by_motor"]
    sim, grounded = (Compliance.of(by_motor[name]) for name in (SIM, GROUNDED))
    if real.plant.robot.motors != sim.motors:
        return None
    return ComplianceReport(sim, grounded, measure(real, NoGrounding(), derive_seed(seed, SECTION)))
