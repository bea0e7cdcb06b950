"""Where data lie: an ellipsoid about samples, and what share of other samples is outside it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

INSIDE = 0.99  # share of unseen samples of the same kind that the ellipsoid holds
RIDGE = 1e-3  # of the correlations: a gait makes all joints nearly collinear
LEAST = 1e-4  # standard deviation of a column [rad, or its own unit]: no encoder sees that a joint is not quite still


class Region(NamedTuple):
    """|whitening (x - mean)| <= bound.

    Attributes:
        mean: Shape (n,).
        whitening: Shape (n, n).
        bound: Radius.
    """

    mean: np.ndarray
    whitening: np.ndarray
    bound: float

    def outside(self, samples: np.ndarray) -> float:
        """Return the share of samples, shape (N, n), that lie outside."""
        return float(np.mean(self._far(samples) > self.bound))

    def _far(self, samples: np.ndarray) -> np.ndarray:
        far: np.ndarray = np.linalg.norm((samples - self.mean) @ self.whitening.T, axis=1)
        return far


def region(samples: np.ndarray, unseen: np.ndarray) -> Region:
    """Return the ellipsoid of samples, shape (N, n), as wide as unseen ones of the same kind, shape (M, n), need it."""
    mean, sd = samples.mean(axis=0), np.maximum(samples.std(axis=0), LEAST)
    scaled = (samples - mean) / sd
    values, axes = np.linalg.eigh(scaled.T @ scaled / len(scaled))
    whitening = (axes / np.sqrt(values + RIDGE)).T / sd
    ellipsoid = Region(mean, whitening, 0.0)
    return ellipsoid._replace(bound=float(np.quantile(ellipsoid._far(unseen), INSIDE)))
