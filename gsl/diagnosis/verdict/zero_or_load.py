"""Zero or load: in the log of one pose a shifted zero and another droop under gravity are one number.

A joint under a load droops by G(q) / kp. Where gravity's torque G hardly changes, a constant offset may as well be a
load or a gain that is off by a share of it. Poses in which gravity pulls otherwise tell them apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.dynamics import gravity_torque
from gsl.core.plant import Plant
from gsl.diagnosis.log.floor import BLOCK
from gsl.diagnosis.simulate.calibration import OFFSET, SPREADS, ZERO
from gsl.diagnosis.simulate.in_the_air import change
from gsl.diagnosis.verdict.findings import Findings
from gsl.policies.limits import Limits, limits


@dataclass(frozen=True)
class Droop:
    """A joint whose zero a log does not show.

    Attributes:
        joint: Its name.
        zero: Offset of the fit [rad].
        wrong: Share by which load or gain would be off instead.
        mover: The joint whose poses change gravity's torque on it most; itself or another.
        ends: Positions of that between which the torque changes most [rad].
        torques: There, of the joint [N·m].
        apart: How far the two explanations are apart between these [rad].
        separable: Whether a ladder of such poses tells them apart.
    """

    joint: str
    zero: float
    wrong: float
    mover: str
    ends: tuple[float, float]
    torques: tuple[float, float]
    apart: float
    separable: bool


def find_droops(findings: Findings) -> tuple[Droop, ...]:
    """Return the joints of which a log in the air does not tell a zero from a load, those of little offset left out."""
    log, n, how = findings.log, len(findings.log.joints), findings.options.design
    if log.walking:
        return ()
    plant = findings.corrected
    zero = _zeros(plant, n) - _zeros(findings.simulator.plant, n)
    pull, stiffness = _statics(findings, plant)
    droop = pull / stiffness
    mean = np.abs(droop.mean(axis=0)).clip(1e-9)
    wrong, left = np.abs(zero) / mean, np.abs(zero) * np.abs(droop - droop.mean(axis=0)) / mean
    usual = how.zero * findings.simulator.spread * np.hypot(*SPREADS[[ZERO, OFFSET]])
    least = np.maximum(log.comparison.floor[:n], usual)
    count = len(log.pieces) / len(droop) * max(1.0, log.pieces.scored / BLOCK)  # means over a block are worth one each
    unsure = [
        k
        for k in range(n)
        if np.abs(zero[k]) > least[k] and wrong[k] <= how.wrong and not _shows(findings, k, left[:, k], count)
    ]
    if not unsure:
        return ()
    positions = _positions(limits(log.robot), how.positions)
    pull = _pull_of_movers(plant, limits(log.robot), positions)
    return tuple(_droop(findings, plant, k, float(zero[k]), float(wrong[k]), pull, positions) for k in unsure)


def _zeros(plant: Plant, n: int) -> np.ndarray:
    """Return where joints stand off in the log, by their servos or by their sensors [rad], shape (n,)."""
    return (plant.servo.offset + plant.sensors.bias)[:n]


def _statics(findings: Findings, plant: Plant) -> tuple[np.ndarray, np.ndarray]:
    """Return gravity's torque [N·m] and the stiffness [N·m/rad] in windows under what is known, shape (W, n_joints)."""
    pieces, n = findings.log.pieces, len(findings.log.joints)
    pull, stiffness = [], []
    poses = pieces.real.mean(axis=1)
    every = max(1, -(-len(poses) // findings.options.design.windows))
    for conditions, index in pieces.alike:
        under = change(plant, conditions)
        robot = lump(under.robot)
        some = index[::every]
        pull += [_torque(under, robot, pose) for pose in poses[some, :n]]
        stiffness += [under.servo.kp[:n].clip(1e-9)] * len(some)
    return np.array(pull), np.array(stiffness)


def _shows(findings: Findings, k: int, left: np.ndarray, count: float) -> bool:
    """Whether what a load would leave of a zero shows: against noise in all, and once against what does not matter."""
    noise, options = findings.log.noise.sd[k], findings.options
    distance = count * float(((left / noise) ** 2).sum())
    return bool(distance > options.design.told_apart and left.max() > options.tolerance)


def _droop(
    findings: Findings, plant: Plant, k: int, zero: float, wrong: float, pull: np.ndarray, positions: np.ndarray
) -> Droop:
    """Return a joint with the mover, of all in `pull`, between whose poses gravity's torque on it differs most."""
    log, how, stiffness = findings.log, findings.options.design, max(float(plant.servo.kp[k]), 1e-9)
    change_of_torque = np.ptp(pull[..., k], axis=1)
    change_of_torque[k] *= how.own
    mover = int(np.argmax(change_of_torque))
    torques = pull[mover, :, k]
    low, high = sorted((int(torques.argmin()), int(torques.argmax())))
    poses, apart = positions[mover], wrong * float(np.ptp(torques)) / stiffness
    count = how.plays * max(1.0, how.hold / log.period / BLOCK)
    return Droop(
        log.joints[k], zero, wrong, log.joints[mover], (float(poses[low]), float(poses[high])),
        (float(torques[low]), float(torques[high])), apart,
        _shows(findings, k, np.abs(np.linspace(-0.5, 0.5, how.rungs)) * apart, count),
    )  # fmt: skip


def _pull_of_movers(plant: Plant, bounds: Limits, positions: np.ndarray) -> np.ndarray:
    """Return gravity's torque on every joint while one after the other moves, shape (n_movers, positions, n_joints)."""
    robot = lump(plant.robot)
    pull = np.zeros((*positions.shape, len(bounds.joints)))
    for mover, stops in enumerate(positions):
        for number, position in enumerate(stops):
            pose = bounds.rest.copy()
            pose[mover] = position
            pull[mover, number] = _torque(plant, robot, pose)
    return pull


def _positions(bounds: Limits, count: int) -> np.ndarray:
    """Return the positions of each joint within its room that are looked at [rad], shape (n_joints, count)."""
    return np.linspace(bounds.rest - bounds.down, bounds.rest + bounds.up, count, axis=1)


def _torque(plant: Plant, robot: Robot, pose: np.ndarray) -> np.ndarray:
    """Return the torques of the logged joints, the first motors, that hold a pose [N·m], shape (n_joints,)."""
    angles = dict(zip(robot.motors, pose[robot.drive].tolist(), strict=True))
    return gravity_torque(robot, angles, plant.gravity)[: len(pose)]
