"""The torque noise of one episode: what the motors bear besides their servos at every physics step."""

from __future__ import annotations

import numpy as np


class TorqueNoise:
    """Draws load torques, a constant for the episode and white noise on top.

    Args:
        sd: Standard deviations at each physics step and of the constant [N·m], shape (2, n_motors).
        substeps: Physics steps in a control period.
        rng: Of the episode.
    """

    def __init__(self, sd: np.ndarray, substeps: int, rng: np.random.Generator) -> None:
        self._sd, self._shape, self._rng = sd[0], (substeps, sd.shape[1]), rng
        self._constant = sd[1] * rng.standard_normal(sd.shape[1])

    def draw(self) -> np.ndarray:
        """Return the torques of the next control period [N·m], shape (substeps, n_motors)."""
        return self._constant + self._sd * self._rng.standard_normal(self._shape)
