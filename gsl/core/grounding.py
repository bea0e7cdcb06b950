"""The grounding equation: which action makes the simulator do what the real robot would do.

    g(s, a) = (1 - alpha) a + alpha f_inv(s, f(s, a))

Hanna, Desai, Karnan, Warnell, Stone: Grounded action transformation for sim-to-real reinforcement learning (2021).
"""

from __future__ import annotations

import numpy as np


def ground(action: np.ndarray, inverse: np.ndarray, alpha: float | np.ndarray) -> np.ndarray:
    """Return the grounded action, shape (n,).

    Args:
        action: What the agent issued, a [rad], shape (n,).
        inverse: What has the predicted effect in the simulator, f_inv(s, f(s, a)) [rad], shape (n,).
        alpha: How far to go from the one to the other, in [0, 1], one for all or shape (n,).
    """
    sent: np.ndarray = action + alpha * (inverse - action)
    return sent


def gain(sensitivity: np.ndarray, damping: float) -> np.ndarray:
    """Return K = (B'B + lambda I)^-1 B', which turns a wanted change of the effect into a change of the action.

        K d = argmin_delta |B delta - d|^2 + lambda |delta|^2,   lambda = damping * trace(B'B) / n

    With torque servos an action moves a joint little within a tick: without damping K would amplify every error.

    Args:
        sensitivity: B, the effect's derivative by the action, shape (n, n).
        damping: In units of the mean squared sensitivity, above 0.
    """
    square = sensitivity.T @ sensitivity
    ridge = damping * np.trace(square) / len(square)
    gains: np.ndarray = np.linalg.solve(square + ridge * np.eye(len(square)), sensitivity.T)
    return gains


def solve_action(action: np.ndarray, correction: np.ndarray, wanted: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Return a + K (f(s, a) - f_sim(s, a)), the action that has the wanted effect: a itself where sim = real.

    Args:
        action: a [rad], shape (n,).
        correction: K of `gain`, shape (n, n).
        wanted: f(s, a), effect of the action on the real robot [rad], shape (n,).
        expected: f_sim(s, a), its effect in the simulator [rad], shape (n,).
    """
    target: np.ndarray = action + correction @ (wanted - expected)
    return target
