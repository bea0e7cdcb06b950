"""Zeros and loads: in the log of one pose a shifted zero and another droop under gravity are one number.

A joint under a load droops by G(q) / kp. Where gravity's torque G hardly changes, a constant offset may as well be a
load or a gain that is off by a share of it. Poses in which gravity pulls otherwise tell them apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsl.core.body import Robot, lumped
from gsl.core.dynamics import forward_kinematics, jacobian
from gsl.core.plant import Plant
from gsl.diagnosis import nuisance
from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.experiment import Experiment
from gsl.diagnosis.menu import Dish
from gsl.diagnosis.noise_floor import MEAN
from gsl.effects.effect import applied, built
from gsl.policies.limits import Limits, limits

WRONG = 1.0  # share of a load beyond which it is no longer taken for wrong instead of the zero
FAR = 1.5  # spreads of the zeros of one make beyond which a zero is worth a thought
SURE = 30.0  # squared distance, in noise, from which on a log tells the two apart
LOOKED_AT = 60  # windows
RUNGS = 5  # poses of the ladder
TRIED = 21  # positions of a joint between which the farthest two are chosen
HOLD, WAY = 0.8, 0.8  # of a rung, and least time from one to the next [s]
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
    plant = _answered(found)
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
    return tuple(_droop(found, plant, k, float(zero[k]), float(wrong[k])) for k in unsure)


def _answered(found: Findings) -> Plant:
    """Return the simulator with what was found and the calibration that goes with it."""
    return nuisance.calibrated(applied(found.simulator.plant, built(found.answer.effects)), found.answer.fit.nuisances)


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
        pull += [gravity_torque(under, robot, pose)[:n] for pose in poses[some, :n]]
        stiffness += [under.servo.kp[:n].clip(1e-9)] * len(some)
    return np.array(pull), np.array(stiffness)


def _seen(found: Findings, k: int, left: np.ndarray, count: float) -> bool:
    """Whether what a load would leave of a zero shows: against noise in all, and once against what does not matter."""
    noise = found.experiment.noise.sd[k]
    return bool(count * float(((left / noise) ** 2).sum()) > SURE and left.max() > found.tolerance)


def _droop(found: Findings, plant: Plant, k: int, zero: float, wrong: float) -> Droop:
    """Return a joint with the poses of a mover, within its room, between which gravity's torque on it differs most."""
    bounds, robot = limits(found.experiment.robot), lumped(plant.robot)
    stiffness = max(float(plant.servo.kp[k]), 1e-9)
    best: tuple[float, int, np.ndarray, np.ndarray] = (-1.0, k, np.zeros(TRIED), np.zeros(TRIED))
    for mover in (k, *(other for other in range(len(bounds.joints)) if other != k)):
        tried = np.linspace(bounds.rest[mover] - bounds.down[mover], bounds.rest[mover] + bounds.up[mover], TRIED)
        poses = np.repeat(bounds.rest[None], TRIED, axis=0)
        poses[:, mover] = tried
        pull = np.array([gravity_torque(plant, robot, pose)[k] for pose in poses])
        if np.ptp(pull) > 1.2 * best[0]:  # another joint only where that is worth it
            best = float(np.ptp(pull)), mover, tried, pull
    most, mover, tried, pull = best
    low, high = sorted((int(pull.argmin()), int(pull.argmax())))
    rungs = np.abs(np.linspace(-0.5, 0.5, RUNGS)) * wrong * most / stiffness
    count = PLAYS * max(1.0, HOLD / found.experiment.period / MEAN)
    return Droop(
        bounds.joints[k], zero, wrong, bounds.joints[mover], (float(tried[low]), float(tried[high])),
        (float(pull[low]), float(pull[high])), wrong * most / stiffness, _seen(found, k, rungs, count),
    )  # fmt: skip


def gravity_torque(plant: Plant, robot: Robot, pose: np.ndarray) -> np.ndarray:
    """Return the torque that holds a robot against gravity, base in the air [N·m], shape (n_motors,).

    Args:
        plant: With masses and gravity.
        robot: The plant's, without fixed joints.
        pose: Positions of the controlled joints [rad], shape (n_joints,).
    """
    frames = forward_kinematics(robot, dict(zip(robot.motors, pose[robot.drive].tolist(), strict=True)))
    torque = np.zeros(len(robot.motors))
    for link in robot.links.values():
        torque -= link.mass * jacobian(robot, frames, link.name, link.com)[1][:, 6:].T @ plant.gravity
    return torque


def ladder(found: tuple[Droop, ...], robot: Robot, period: float) -> Dish:
    """Return held rungs between the ends of one joint after the other, the other way round in the second variant.

    Args:
        found: The joints.
        robot: Theirs.
        period: Control period [s].
    """
    bounds = limits(robot)
    up = np.concatenate([_climb(bounds, one, period, reverse=False) for one in found])
    down = np.concatenate([_climb(bounds, one, period, reverse=True) for one in reversed(found)])
    return Dish("pose_ladder", (("pose_ladder_a", up), ("pose_ladder_b", down)))


def _climb(bounds: Limits, one: Droop, period: float, *, reverse: bool) -> np.ndarray:
    k = bounds.joints.index(one.mover)
    rungs = np.linspace(*(one.ends[::-1] if reverse else one.ends), RUNGS)
    stops = [bounds.rest[k], *rungs, bounds.rest[k]]
    way = []
    for begin, end in zip(stops[:-1], stops[1:], strict=True):
        fastest = np.pi / 2.0 * abs(end - begin) / bounds.speed[k]  # of a cosine, whose middle is the steepest
        ticks = max(1, round(max(WAY, 1.1 * fastest) / period))
        share = 0.5 * (1.0 - np.cos(np.pi * np.arange(1, ticks + 1) / ticks))
        way.append(begin + (end - begin) * share)
        way.append(np.full(round(HOLD / period), end))
    path = np.concatenate(way)
    targets = np.repeat(bounds.rest[None], len(path), axis=0)
    targets[:, k] = path
    return targets
