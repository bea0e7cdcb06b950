"""Gaussian noise on every action of an episode."""

from __future__ import annotations

import numpy as np


class ActionNoiseRun:
    """The noise in one episode.

    Args:
        sd: Standard deviation [rad].
        rng: Its source of randomness.
    """

    def __init__(self, sd: float, rng: np.random.Generator) -> None:
        self._sd, self._rng = sd, rng

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        """Return the noisy action [rad], shape (n_joints,)."""
        if self._sd == 0.0:
            return action
        return action + self._sd * self._rng.standard_normal(len(action))
