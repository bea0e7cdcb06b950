"""Calibration of a stochastic model on trajectories that it was not fitted to: how wide it errs, and for how long.

A likelihood fitted to few trajectories is too sure of itself, and its errors hang together in time, since what pushes a
robot off lasts longer than a tick. Standard deviations are scaled so that errors in their units have variance 1
(Kuleshov, Fenner, Ermon 2018 in general); the correlation of an error with the one a tick before is what draws keep.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gsl.models.head import Head
from gsl.models.network import Network, Samples

SCALE = 0.5, 3.0  # least and largest factor of a standard deviation
MEMORY = 0.9  # largest
ROUNDING = 1e-6  # of a correlation matrix that is singular, as that of one source of noise is


def calibrate(network: Network, head: Head, episodes: Sequence[Samples]) -> tuple[Network, np.ndarray]:
    """Return the network with standard deviations scaled, and the memory of its draws, shape (m,).

    Args:
        network: Of a head that draws.
        head: How its outputs are read.
        episodes: Inputs, shape (T, n), and outputs, shape (T, m), of trajectories it was not fitted to.
    """
    errors = [_standardise(network, head, *episode) for episode in episodes]
    together = np.concatenate(errors)
    scale = np.clip(np.sqrt(np.mean(together**2, axis=0)), *SCALE)
    mean, variance = together.mean(axis=0), together.var(axis=0)
    steps = np.concatenate([(series[:-1] - mean) * (series[1:] - mean) for series in errors])
    memory = np.zeros_like(scale)
    if len(steps):  # an error that never changes, as of a joint that is quite still, has no memory
        np.divide(steps.mean(axis=0), variance, out=memory, where=variance > 0.0)
    *hidden, (weight, bias) = [(weight, bias) for weight, bias in network.layers]
    wider = np.tile(np.log(scale), head.components)  # the last outputs are logarithms of standard deviations
    added = np.concatenate([np.zeros(len(bias) - len(wider)), wider])
    return Network([*hidden, (weight, bias + added)]), np.clip(memory, 0.0, MEMORY)


def mixing(network: Network, head: Head, samples: Samples) -> np.ndarray:
    """Return the factor L of the correlation L Lᵀ of errors, shape (m, m): L times standard normal draws errs alike.

    Noise on an action moves all variables at once; drawn one by one, an inverse model averages it away.

    Args:
        network: Of a head that draws.
        head: How its outputs are read.
        samples: Inputs, shape (N, n), and outputs, shape (N, m), that it was not fitted to.
    """
    errors = _standardise(network, head, *samples)
    moving = errors.std(axis=0) > 0.0
    together = np.eye(errors.shape[1])
    together[np.ix_(moving, moving)] = np.atleast_2d(np.corrcoef(errors[:, moving], rowvar=False))
    return np.linalg.cholesky((1.0 - ROUNDING) * together + ROUNDING * np.eye(len(together)))


def _standardise(network: Network, head: Head, inputs: np.ndarray, outputs: np.ndarray) -> np.ndarray:
    """Return errors in units of the standard deviation that the model has for them, shape (T, m)."""
    raw = network.predict_many(inputs)
    weights, means, sds = head.parts(raw)
    expected = head.expect(raw)
    variance = (weights[..., None] * (sds**2 + (means - expected[:, None]) ** 2)).sum(axis=-2)
    errors: np.ndarray = (outputs - expected) / np.sqrt(variance)
    return errors
