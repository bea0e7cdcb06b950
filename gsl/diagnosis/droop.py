"""Zeros and loads: in the log of one pose a shifted zero and another droop under gravity are one number.

A joint under a load droops by G(q) / kp. Where gravity's torque G hardly changes, a constant offset may as well be a
load or a gain that is off by a share of it. Poses in which gravity pulls otherwise tell them apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsl.core.body import Robot, lumped
from gsl.core.dynamics import gravity_torque
from gsl.core.plant import Plant
from gsl.diagnosis import nuisance
from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.experiment import Experiment
from gsl.diagnosis.noise_floor import MEAN
from gsl.diagnosis.pose_ladder import HOLD, RUNGS
from gsl.effects.effect import applied, built
from gsl.policies.limits import Limits, limits

WRONG = 1.0  # share of a load beyond which it is no longer taken for wrong instead of the zero
FAR = 1.5  # spreads of the zeros of one make beyond which a zero is worth a thought
SURE = 30.0  # squared distance, in noise, from which on a log tells the two apart
LOOKED_AT = 60  # windows
TRIED = 21  # positions of a joint between which the farthest two are chosen
OWN = 1.2  # times as much another joint has to do to be moved in a joint's place
PLAYS = 3  # of a rung: two variants and a repeat


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
        told: Whether a ladder of such poses tells them apart.
    """

    joint: str
    zero: float
    wrong: float
    mover: str
    ends: tuple[float, float]
    torques: tuple[float, float]
    apart: float
    told: bool


def droops(found: Findings) -> tuple[Droop, ...]:
    """Return the joints of which a log in the air does not tell a zero from a load, those of little offset left out."""
    exp, n = found.experiment, len(found.experiment.joints)
    if exp.walking:
        return ()
    plant = found.corrected
    zero = _zeros(plant, n) - _zeros(found.simulator.plant, n)
    pull, stiffness = _statics(found, plant)
    droop = pull / stiffness
    mean = np.abs(droop.mean(axis=0)).clip(1e-9)
    wrong, left = np.abs(zero) / mean, np.abs(zero) * np.abs(droop - droop.mean(axis=0)) / mean
    usual = FAR * found.simulator.spread * np.hypot(*nuisance.SIZES[[nuisance.ZERO, nuisance.OFFSET]])
    least, count = np.maximum(exp.comparison.floor[:n], usual), len(exp.pieces) / len(droop) * _samples(exp)
    unsure = [
        k
        for k in range(n)
        if np.abs(zero[k]) > least[k] and wrong[k] <= WRONG and not _seen(found, k, left[:, k], count)
    ]
    if not unsure:
        return ()
    pull = _reach(plant, limits(exp.robot))
    return tuple(_droop(found, plant, k, float(zero[k]), float(wrong[k]), pull) for k in unsure)


def _zeros(plant: Plant, n: int) -> np.ndarray:
    """Return where joints stand off in the log, by their servos or by their sensors [rad], shape (n,)."""
    return (plant.servo.offset + plant.sensors.bias)[:n]


def _samples(exp: Experiment) -> float:
    """Return how many samples of a window are worth one each: their means over MEAN ticks."""
    return max(1.0, (exp.pieces.real.shape[1] - exp.pieces.warm_up) / MEAN)


def _statics(found: Findings, plant: Plant) -> tuple[np.ndarray, np.ndarray]:
    """Return gravity's torque [N·m] and the stiffness [N·m/rad] in windows under what is known, shape (W, n_joints)."""
    exp, n, pull, stiffness = found.experiment, len(found.experiment.joints), [], []
    poses = exp.pieces.real.mean(axis=1)
    every = max(1, -(-len(poses) // LOOKED_AT))
    for known, index in exp.pieces.alike:
        under = applied(plant, built(known))
        robot = lumped(under.robot)
        some = index[::every]
        pull += [_torque(under, robot, pose) for pose in poses[some, :n]]
        stiffness += [under.servo.kp[:n].clip(1e-9)] * len(some)
    return np.array(pull), np.array(stiffness)


def _seen(found: Findings, k: int, left: np.ndarray, count: float) -> bool:
    """Whether what a load would leave of a zero shows: against noise in all, and once against what does not matter."""
    noise = found.experiment.noise.sd[k]
    return bool(count * float(((left / noise) ** 2).sum()) > SURE and left.max() > found.tolerance)


def _droop(found: Findings, plant: Plant, k: int, zero: float, wrong: float, pull: np.ndarray) -> Droop:
    """Return a joint with the mover, of all in `pull`, between whose poses gravity's torque on it differs most."""
    joints, stiffness = found.experiment.joints, max(float(plant.servo.kp[k]), 1e-9)
    change = np.ptp(pull[..., k], axis=1)
    change[k] *= OWN
    mover = int(np.argmax(change))
    torques = pull[mover, :, k]
    low, high = sorted((int(torques.argmin()), int(torques.argmax())))
    poses, apart = tried(limits(found.experiment.robot))[mover], wrong * float(np.ptp(torques)) / stiffness
    count = PLAYS * max(1.0, HOLD / found.experiment.period / MEAN)
    return Droop(
        joints[k], zero, wrong, joints[mover], (float(poses[low]), float(poses[high])),
        (float(torques[low]), float(torques[high])), apart,
        _seen(found, k, np.abs(np.linspace(-0.5, 0.5, RUNGS)) * apart, count),
    )  # fmt: skip


def _reach(plant: Plant, bounds: Limits) -> np.ndarray:
    """Return gravity's torque on every joint while one after the other moves, shape (n_movers, TRIED, n_joints)."""
    robot, n = lumped(plant.robot), len(bounds.joints)
    pull = np.zeros((n, TRIED, n))
    for mover, positions in enumerate(tried(bounds)):
        for number, position in enumerate(positions):
            pose = bounds.rest.copy()
            pose[mover] = position
            pull[mover, number] = _torque(plant, robot, pose)
    return pull


def tried(bounds: Limits) -> np.ndarray:
    """Return the positions that are tried of each joint within its room [rad], shape (n_joints, TRIED)."""
    return np.linspace(bounds.rest - bounds.down, bounds.rest + bounds.up, TRIED, axis=1)


def _torque(plant: Plant, robot: Robot, pose: np.ndarray) -> np.ndarray:
    """Return the torques of the logged joints, the first motors, that hold a pose [N·m], shape (n_joints,)."""
    angles = dict(zip(robot.motors, pose[robot.drive].tolist(), strict=True))
    return gravity_torque(robot, angles, plant.gravity)[: len(pose)]
