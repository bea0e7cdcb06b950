"""Where a simulation begins: at rest in some joint positions, or in a state measured elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np

from gsl.core.body import MESH, Robot, Shape
from gsl.core.dynamics import forward_kinematics
from gsl.robots.frames import euler
from gsl.robots.meshes import draw_parts, hull_of
from gsl.worlds.physics import Reading

CLEARANCE = 5e-4  # of the lowest sole above the ground [m]
HELD_AT = 1.0  # height of a base that is held in the air [m]
_CORNERS = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1)


class Start(NamedTuple):
    """A state of the robot and what its servos were told before.

    Attributes:
        reading: Positions, velocities and base; its forces are not used.
        commands: Targets so far, newest first [rad], shape (k, n_motors).
    """

    reading: Reading
    commands: np.ndarray


def resting(robot: Robot, positions: np.ndarray, targets: np.ndarray, *, floating: bool) -> Start:
    """Return the start at rest with an upright base, the lowest sole just above the ground.

    Args:
        robot: Without fixed joints.
        positions: Of the motors [rad], shape (n_motors,).
        targets: What the servos hold [rad], shape (n_motors,).
        floating: Whether the robot stands on the ground.
    """
    height = CLEARANCE - lowest_point(robot, positions) if floating else HELD_AT
    place, still = np.array([0.0, 0.0, height]), np.zeros(3)
    motion = np.array([positions, np.zeros(len(positions))])
    return Start(Reading(motion, place, (0.0, 0.0, 0.0, 1.0), still, still, 1.0, np.zeros(0)), targets[None])


def lowest_point(robot: Robot, positions: np.ndarray, turn: np.ndarray | None = None) -> float:
    """Return the height of the lowest corner of a colliding box or hull over the base's origin [m].

    Args:
        robot: Without fixed joints.
        positions: Of the motors [rad], shape (n_motors,).
        turn: From base to world axes, shape (3, 3), by default upright.
    """
    up = np.array([0.0, 0.0, 1.0]) if turn is None else turn[2]
    soles = [up @ box for shape, box in _boxes(robot, positions) if shape.collides and shape.kind in ("box", MESH)]
    return min([0.0, *(float(heights.min()) for heights in soles)])


def extent(robot: Robot, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and greatest coordinates of all shapes in base axes [m], both of shape (3,).

    Args:
        robot: Without fixed joints.
        positions: Of the motors [rad], shape (n_motors,).
    """
    corners = np.concatenate([np.zeros((3, 1)), *(box for s, box in _boxes(robot, positions) if s.shown)], axis=1)
    return corners.min(axis=1), corners.max(axis=1)


def _boxes(robot: Robot, positions: np.ndarray) -> Iterator[tuple[Shape, np.ndarray]]:
    """Yield every shape with points in base axes whose hull it fills [m], shape (3, n)."""
    frames = forward_kinematics(robot, dict(zip(robot.motors, positions.tolist(), strict=True)))
    for name, link in robot.links.items():
        for shape in link.shapes:
            yield shape, frames.origin[name][:, None] + frames.turn[name] @ _corners(shape)


def _corners(shape: Shape) -> np.ndarray:
    """Return points in link axes whose hull a shape fills [m], shape (3, n)."""
    if shape.kind != MESH:
        return _box_corners(shape)
    if shape.collides:
        return hull_of(shape).vertices.T
    points = np.concatenate([np.array([shape.centre]), *(part.vertices for part in draw_parts(shape))])
    low, high = points.min(axis=0), points.max(axis=0)
    return (high - low)[:, None] * _CORNERS + 0.5 * (low + high)[:, None]


@cache
def _box_corners(shape: Shape) -> np.ndarray:
    return euler(*shape.turn) @ (_edges(shape)[:, None] * _CORNERS) + np.array(shape.centre)[:, None]


def _edges(shape: Shape) -> np.ndarray:
    """Return the edges of the box around a shape [m], shape (3,)."""
    if shape.kind == "box":
        return np.array(shape.size)
    edges = np.full(3, 2.0 * shape.size[0])
    if shape.kind == "cylinder":
        edges["xyz".index(shape.along)] = shape.size[1]
    return edges
