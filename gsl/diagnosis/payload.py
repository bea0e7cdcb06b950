"""A known weight: friction that grows with the load is told from friction that does not by loads that differ."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gsl.core.body import lumped
from gsl.core.plant import Plant
from gsl.diagnosis.attribute import Hypothesis
from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.droop import gravity_at
from gsl.diagnosis.questions import question
from gsl.diagnosis.records import Record
from gsl.diagnosis.rehearsal import Rehearsal
from gsl.effects.effect import applied, built

WEIGHT, LOADED, OTHERS = "link_mass", "load_friction", ("coulomb_friction", "stribeck_friction")
WEIGHTS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)  # that one has at hand [kg]
HOLDS = 0.5  # share of a motor's torque that gravity may take with it
LIGHT = 0.05  # share of the moving mass below which a link (a finger, a cover) is no place for it
LONG = 200.0  # of the log, that is rehearsed [s]
BETTER = 2.0  # times the log-odds of a mere repeat, from which on it is worth the trouble


class Payload(NamedTuple):
    """A weight that a robot's own motions are played with.

    Attributes:
        link: Where it is fixed.
        mass: Of it [kg].
        rival: Effect that is told from friction under load.
        better: How many times the log-odds of playing the same motions bare once more.
    """

    link: str
    mass: float
    rival: str
    better: float


def payload(found: Findings) -> Payload | None:
    """Return the weight that tells friction under load from other friction; None if that is no question or no help."""
    chosen, exp = found.selection.chosen, found.experiment
    if exp.walking or LOADED not in chosen.names or found.verdict.word != "causes":
        return None
    if any(WEIGHT in one.conditions for one in exp.records):
        return None  # loads differ already
    rival = next((one for one in found.selection.tried if _without_load(one, chosen)), None)
    weight = _weight(found) if rival is not None else None
    if rival is None or weight is None:
        return None
    asked = question(chosen, rival, len(exp.joints))
    bare = _some(found)
    odds = [
        float(Rehearsal.again(found, [*bare, *beside]).log_odds(asked.truth, asked.rivals)[0])
        for beside in (bare, [_under(one, *weight) for one in bare])
    ]
    better = odds[1] / max(odds[0], 1e-9)
    return Payload(*weight, asked.names[1], better) if better > BETTER else None


def _without_load(one: Hypothesis, chosen: Hypothesis) -> bool:
    """Whether a hypothesis of as many effects has another friction in the place of the one under load."""
    others = set(one.names) - set(chosen.names)
    return LOADED not in one.names and len(one.candidates) == len(chosen.candidates) and bool(others & set(OTHERS))


def _some(found: Findings) -> list[Record]:
    """Return motions of the log, spread over it, as many as are not too long together."""
    records = found.experiment.records
    order = np.random.default_rng(0).permutation(len(records))
    ends = found.experiment.period * np.cumsum([len(records[k]) for k in order])
    return [records[k] for k in order[: max(1, int((ends <= LONG).sum()))]]


def _under(one: Record, link: str, mass: float) -> Record:
    known = {**one.conditions, WEIGHT: {"link": link, "mass": mass}}
    return replace(one, about={**one.about, "conditions": known})


def _weight(found: Findings) -> tuple[str, float] | None:
    """Return the link that shows a weight most, and the heaviest one that the motors hold in the poses of the log."""
    exp, plant = found.experiment, found.corrected
    n, poses = len(exp.joints), exp.pieces.real.mean(axis=1)[:, : len(exp.joints)]
    poses = poses[:: max(1, len(poses) // 40)]
    robot, bare = lumped(plant.robot), gravity_at(plant, poses)
    moving = [joint.child for joint in robot.joints]
    whole = sum(robot.links[name].mass for name in moving)
    places = [name for name in moving if robot.links[name].mass >= LIGHT * whole]
    pulls = {name: gravity_at(_with(plant, name, WEIGHTS[0]), poses) - bare for name in places}
    link = max(places, key=lambda name: float(np.abs(pulls[name]).sum()))
    room = HOLDS * plant.servo.limit[:n]
    held = [one for one in WEIGHTS if (np.abs(bare + one / WEIGHTS[0] * pulls[link]) <= room).all()]
    return (link, held[-1]) if held else None


def _with(plant: Plant, link: str, mass: float) -> Plant:
    return applied(plant, built({WEIGHT: {"link": link, "mass": mass}}))
