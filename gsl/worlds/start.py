"""Where a simulation begins: at rest in some joint positions, or in a state measured elsewhere."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gsl.core.body import Robot
from gsl.core.dynamics import forward_kinematics
from gsl.worlds.engine import Reading

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
    return Start(Reading(motion, place, (0.0, 0.0, 0.0, 1.0), still, still, 1.0, ()), targets[None])


def lowest_point(robot: Robot, positions: np.ndarray, turn: np.ndarray | None = None) -> float:
    """Return the height of the lowest corner of a colliding box over the base's origin [m].

    Args:
        robot: Without fixed joints.
        positions: Of the motors [rad], shape (n_motors,).
        turn: From base to world axes, shape (3, 3), by default upright.
    """
    frames = forward_kinematics(robot, dict(zip(robot.motors, positions.tolist(), strict=True)))
    up = np.array([0.0, 0.0, 1.0]) if turn is None else turn[2]
    heights = [0.0]
    for name, link in robot.links.items():
        for shape in link.shapes:
            if shape.collides and shape.kind == "box":
                box = Rotation.from_euler("xyz", shape.turn).as_matrix() @ (np.array(shape.size)[:, None] * _CORNERS)
                corners = box + np.array(shape.centre)[:, None]
                heights.append(float((up @ (frames.origin[name][:, None] + frames.turn[name] @ corners)).min()))
    return min(heights)
