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
def base_motion(
    axes: np.ndarray,
    com: np.ndarray,
    centre: tuple[float, float, float],
    quaternion: tuple[float, float, float, float],
    linear: tuple[float, float, float],
    angular: tuple[float, float, float],
) -> BaseMotion:
    """Return the motion of the link frame.

    Args:
        axes: Of the inertial frame in link axes, columns, shape (3, 3).
        com: Centre of mass in link axes [m], shape (3,).
        centre: Position of the centre of mass [m].
        quaternion: Orientation of the inertial frame, x y z w.
        linear: Velocity of the centre of mass in world axes [m/s].
        angular: Angular velocity in world axes [rad/s].
    """
    x, y, z, w = quaternion
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
