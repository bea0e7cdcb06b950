"""Scaling to zero mean and unit variance, column by column."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

LEAST = 5e-3  # of the largest standard deviation, by which a column is divided at least: an encoder sees no less


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
    """Return the scaling of a sample, shape (N, n).

    A column that hardly changes stays small: what a joint at rest does must not become a regressor.
    """
    sd = values.std(axis=0)
    return Scaling(values.mean(axis=0), np.maximum(sd, LEAST * sd.max()) if sd.any() else np.ones_like(sd))
