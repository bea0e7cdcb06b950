"""Pose and velocity of the base's link frame, from those of the inertial frame that Bullet reports."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsl.core.compiled import compile_kernel


class BaseMotion(NamedTuple):
    """The base's link frame.

    Attributes:
        turn: From base to world axes, shape (3, 3).
        place: Position in world axes [m], shape (3,).
        velocity: In world axes [m/s], shape (3,).
        gyro: Angular velocity in base axes [rad/s], shape (3,).
    """

    turn: np.ndarray
    place: np.ndarray
    velocity: np.ndarray
    gyro: np.ndarray


@compile_kernel
def base_motion(axes: np.ndarray, com: np.ndarray, pose: np.ndarray, speed: np.ndarray) -> BaseMotion:
    """Return the motion of the link frame.

    Args:
        axes: Of the inertial frame in link axes, columns, shape (3, 3).
        com: Centre of mass in link axes [m], shape (3,).
        pose: Position of the centre of mass [m] and orientation of the inertial frame, x y z w, shape (7,).
        speed: Velocity of the centre of mass [m/s] and angular velocity [rad/s] in world axes, shape (6,).
    """
    centre, linear, angular = pose[:3], speed[:3], speed[3:]
    x, y, z, w = pose[3:]
    inertial = np.empty((3, 3))
    inertial[0] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)
    inertial[1] = 2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)
    inertial[2] = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)
    turn, lever, place, velocity, gyro = np.zeros((3, 3)), np.zeros(3), np.empty(3), np.empty(3), np.zeros(3)
    for i in range(3):
        for j in range(3):
            for k in range(3):
                turn[i, j] += inertial[i, k] * axes[j, k]
            lever[i] += turn[i, j] * com[j]
        place[i] = centre[i] - lever[i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        velocity[i] = linear[i] - (angular[j] * lever[k] - angular[k] * lever[j])
        for m in range(3):
            gyro[i] += angular[m] * turn[m, i]
    return BaseMotion(turn, place, velocity, gyro)
