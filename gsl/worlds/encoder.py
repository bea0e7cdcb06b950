"""What the joint encoders tell servo and log: the output, or the rotor behind the gear, now or some time ago."""

from __future__ import annotations

import numpy as np

from gsl.core.compiled import compiled

REMEMBERED = 128  # physics steps: the longest sensor delay


@compiled
def seen(
    delay: float, history: np.ndarray, count: int, current: np.ndarray, row: int, i: int, step: float
) -> float:  # fmt: skip
    """Return what an encoder tells, linear between the physics steps and so continuous in its delay.

    Args:
        delay: Age of what it tells [s].
        history: Of the physics steps so far, a ring, shape (REMEMBERED, 2, n_motors).
        count: Steps so far; the newest is at (count - 1) % REMEMBERED.
        current: Positions [rad] and velocities [rad/s] at the encoder now, shape (2, n_motors).
        row: 0 for the position, 1 for the velocity.
        i: Motor.
        step: Physics period [s].
    """
    age = delay / step
    whole = int(age)
    share = age - whole
    newer = current[row, i] if whole == 0 else history[(count - whole) % REMEMBERED, row, i]
    older = history[(count - whole - 1) % REMEMBERED, row, i]
    return float((1.0 - share) * newer + share * older)


@compiled
def first_history(motion: np.ndarray, step: float) -> np.ndarray:
    """Return the history of joints that have moved at constant speed, shape (REMEMBERED, 2, n_motors).

    Args:
        motion: Positions [rad] and velocities [rad/s] now, shape (2, n_motors).
        step: Physics period [s].
    """
    history = np.empty((REMEMBERED, 2, motion.shape[1]))
    for k in range(REMEMBERED):
        history[k, 0] = motion[0] - (REMEMBERED - k) * step * motion[1]
        history[k, 1] = motion[1]
    return history
