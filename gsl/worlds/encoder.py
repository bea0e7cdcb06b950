"""What the joint encoders tell servo and log: the output, or the rotor behind the gear, now or some time ago."""

from __future__ import annotations

import numpy as np

from gsl.core.compiled import compile_inner, compile_kernel

REMEMBERED = 256  # physics steps: the longest sensor delay


@compile_inner
def read_encoder(delay: float, history: np.ndarray, count: int, now: float, row: int, i: int, step: float) -> float:
    """Return what an encoder tells, linear between the physics steps and so continuous in its delay.

    Args:
        delay: Age of what it tells [s].
        history: Of the physics steps so far, a ring, shape (REMEMBERED, 2, n_motors).
        count: Steps so far; the newest is at (count - 1) % REMEMBERED.
        now: What the encoder measures at this moment.
        row: 0 for the position, 1 for the velocity.
        i: Motor.
        step: Physics period [s].
    """
    age = delay / step
    whole = int(age)
    share = age - whole
    newer = now if whole == 0 else history[(count - whole) % REMEMBERED, row, i]
    older = history[(count - whole - 1) % REMEMBERED, row, i]
    return (1.0 - share) * newer + share * older


@compile_kernel
def first_history(motion: np.ndarray, step: float) -> np.ndarray:
    """Return the history of joints that have moved at constant speed, shape (REMEMBERED, 2, n_motors).

    Args:
        motion: Positions [rad] and velocities [rad/s] now, shape (2, n_motors).
        step: Physics period [s].
    """
    history = np.empty((REMEMBERED, 2, motion.shape[1]))
    fill_history(history, motion, step)
    return history


@compile_inner
def fill_history(history: np.ndarray, motion: np.ndarray, step: float) -> None:
    """Write the same into a given array; floats or lanes."""
    for k in range(REMEMBERED):
        for i in range(motion.shape[1]):
            history[k, 0, i] = motion[0, i] - (REMEMBERED - k) * step * motion[1, i]
            history[k, 1, i] = motion[1, i]
