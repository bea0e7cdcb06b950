"""Scaling to zero mean and unit variance, column by column."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Scaling(NamedTuple):
    """scaled = (values - mean) / sd, each of shape (n,)."""

    mean: np.ndarray
    sd: np.ndarray

    def apply(self, values: np.ndarray) -> np.ndarray:
        """Return scaled values, shape (..., n)."""
        scaled: np.ndarray = (values - self.mean) / self.sd
        return scaled

    def undo(self, scaled: np.ndarray) -> np.ndarray:
        """Return the values, shape (..., n)."""
        values: np.ndarray = scaled * self.sd + self.mean
        return values


def scaling(values: np.ndarray) -> Scaling:
    """Return the scaling of a sample, shape (N, n); a column that never changes is only shifted."""
    sd = values.std(axis=0)
    return Scaling(values.mean(axis=0), np.where(sd > 1e-9, sd, 1.0))
