"""The two sides of a robot, read off its geometry: which joints mirror each other, and which way is inwards."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.dynamics import forward_kinematics

SAME_PLACE = 1e-3  # [m]
LEVER = 0.02  # of a limb's centre of mass about a joint, sideways, below which nothing comes nearer [m]
_ANGLE = 1e-4  # of the difference quotient [rad]
_MIRROR = np.array([1.0, -1.0, 1.0])  # in the plane y = 0


class Pair(NamedTuple):
    """Two controlled joints by index; `sign` times the left one's angle mirrors its motion on the right."""

    left: int
    right: int
    sign: float


def pairs(robot: Robot) -> tuple[Pair, ...]:
    """Return the controlled joints that are mirror images of each other; the axis of a hinge is a pseudo-vector."""
    frames = forward_kinematics(lump(robot), {})
    joints = [robot.joint(name) for name in robot.controlled]
    places = np.array([frames.origin[joint.child] for joint in joints])
    axes = np.array([frames.axis[joint.name] / joint.lever for joint in joints])
    slides = np.array([joint.slides for joint in joints])
    mirrored = np.where(slides[:, None], _MIRROR, -_MIRROR) * axes
    along = np.where(slides[:, None] == slides, axes @ mirrored.T, 0.0)
    apart = np.linalg.norm(places[:, None] - _MIRROR * places, axis=2)
    fits = (apart < SAME_PLACE) & (np.abs(along) > 1.0 - SAME_PLACE) & (places[:, 1:2] > SAME_PLACE)
    return tuple(Pair(int(i), int(j), float(np.sign(along[i, j]))) for i, j in np.argwhere(fits))


def inwards(robot: Robot, angles: Mapping[str, float]) -> np.ndarray:
    """Return the sign in which each controlled joint brings its limb to the middle plane, 0 for none, shape (n,)."""
    here, masses = _centres(robot, angles), np.array([link.mass for link in lump(robot).links.values()])
    signs = np.zeros(len(robot.controlled))
    for index, name in enumerate(robot.controlled):
        moved = _centres(robot, {**angles, name: angles.get(name, 0.0) + _ANGLE}) - here
        limb = masses * np.any(moved != 0.0, axis=1)
        lever, side = limb @ moved[:, 1] / _ANGLE, limb @ here[:, 1]
        if abs(lever) > LEVER * limb.sum() and abs(side) > LEVER * limb.sum():
            signs[index] = -np.sign(lever * side)
    return signs


def _centres(robot: Robot, angles: Mapping[str, float]) -> np.ndarray:
    """Return the links' centres of mass in base axes [m], shape (n_links, 3)."""
    body = lump(robot)
    frames = forward_kinematics(body, angles)
    return np.array([frames.origin[name] + frames.turn[name] @ link.com for name, link in body.links.items()])
