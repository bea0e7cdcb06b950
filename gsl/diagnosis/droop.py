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
from gsl.diagnosis.menu import Dish
from gsl.policies.limits import Limits, limits

WRONG = 1.0  # share of a load beyond which it is no longer taken for wrong instead of the zero
FAR = 1.5  # spreads of the zeros of one make beyond which a zero is worth a thought
LOOKED_AT = 60  # windows
RUNGS = 5  # poses of the ladder
TRIED = 21  # positions of a joint between which the farthest two are chosen
HOLD, WAY = 0.8, 0.8  # of a rung, and least time from one to the next [s]
APART = 2.0  # floors by which a ladder has to tell the two apart


@dataclass(frozen=True)
class Droop:
    """A joint whose zero a log does not show.

    Attributes:
        joint: Its name.
        zero: Offset of the fit [rad].
        wrong: Share by which load or gain would be off instead.
        ends: Positions between which gravity's torque changes most [rad].
        torques: There [N·m].
        apart: How far the two explanations are apart between these [rad].
        told: Whether that is enough.
    """

    joint: str
    zero: float
    wrong: float
    ends: tuple[float, float]
    torques: tuple[float, float]
    apart: float
    told: bool


def droops(found: Findings) -> tuple[Droop, ...]:
    """Return the joints of which a log in the air does not tell a zero from a load, those of little offset left out."""
    exp, plant = found.experiment, found.simulator.plant
    if exp.walking:
        return ()
    robot, n = lumped(plant.robot), len(exp.joints)
    windows = exp.pieces.real.mean(axis=1)
    poses = windows[np.unique(np.linspace(0, len(windows) - 1, min(LOOKED_AT, len(windows))).round().astype(int))]
    nuisances, floor = found.answer.fit.nuisances, exp.comparison.floor[:n]
    zero = (nuisances[nuisance.ZERO] + nuisances[nuisance.OFFSET])[:n]
    stiffness = (plant.servo.kp[:n] * np.exp(nuisances[nuisance.KP, :n])).clip(1e-9)
    pull = np.array([gravity_torque(plant, robot, pose) for pose in poses])[:, :n]
    load, change = np.abs(pull.mean(axis=0)).clip(1e-9), pull.std(axis=0)
    wrong = np.abs(zero) * stiffness / load
    usual = FAR * found.simulator.spread * np.hypot(*nuisance.SIZES[[nuisance.ZERO, nuisance.OFFSET]])
    unseen = (np.abs(zero) > np.maximum(floor, usual)) & (wrong <= WRONG) & (np.abs(zero) * change / load < floor)
    bounds = limits(exp.robot)
    return tuple(
        _droop(plant, robot, bounds, int(k), zero[k], wrong[k], stiffness[k], floor[k]) for k in np.flatnonzero(unseen)
    )


def _droop(
    plant: Plant, robot: Robot, bounds: Limits, k: int, zero: float, wrong: float, stiffness: float, floor: float
) -> Droop:
    """Return a joint with the two positions, within its room, where gravity's torque differs most."""
    tried = np.linspace(bounds.rest[k] - bounds.down[k], bounds.rest[k] + bounds.up[k], TRIED)
    poses = np.repeat(bounds.rest[None], TRIED, axis=0)
    poses[:, k] = tried
    pull = np.array([gravity_torque(plant, robot, pose)[k] for pose in poses])
    ends = sorted((int(pull.argmin()), int(pull.argmax())))
    apart = wrong * float(np.ptp(pull)) / stiffness
    low, high = (float(tried[end]) for end in ends)
    return Droop(
        bounds.joints[k], float(zero), float(wrong), (low, high), (float(pull[ends[0]]), float(pull[ends[1]])), apart,
        apart > APART * floor,
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
    k = bounds.joints.index(one.joint)
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
