"""Pose and velocity of the base's link frame, from those of the inertial frame that Bullet reports."""

from __future__ import annotations

import numpy as np

from gsl.core.compiled import compile_kernel

TURN, PLACE, VELOCITY, GYRO = slice(3), 3, 4, 5
"""Rows of the link frame's motion, shape (6, 3): from base to world axes; position [m] and velocity [m/s] in world
axes; angular velocity in base axes [rad/s]."""


@compile_kernel
def fill_base_motion(axes: np.ndarray, com: np.ndarray, base: np.ndarray, frame: np.ndarray) -> None:
    """Fill in the motion of the link frame.

    Args:
        axes: Of the inertial frame in link axes, columns, shape (3, 3).
        com: Centre of mass in link axes [m], shape (3,).
        base: Position of the centre of mass [m] and orientation of the inertial frame, x y z w; velocity of the centre
            of mass [m/s] and angular velocity [rad/s] in world axes; shape (13,).
        frame: Result, see above, shape (6, 3).
    """
    centre, linear, angular = base[:3], base[7:10], base[10:]
    x, y, z, w = base[3], base[4], base[5], base[6]
    inertial = np.empty((3, 3))
    inertial[0] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)
    inertial[1] = 2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)
    inertial[2] = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)
    lever, turn, place, velocity, gyro = np.zeros(3), frame[:3], frame[3], frame[4], frame[5]
    turn[:], gyro[:] = 0.0, 0.0
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
