"""A linear model: ridge regression in closed form."""

from __future__ import annotations

import numpy as np

from gsl.core.scaling import scaling
from gsl.models.network import Network, unscale

SMALLEST = 1e-6  # standard deviation [rad], of a change that is exact


def fit_linear(inputs: np.ndarray, targets: np.ndarray, *, ridge: float) -> Network:
    """Return W, b that minimise |W z + b - y|^2 / N + ridge |W|^2, where z and y are scaled to unit variance.

    Args:
        inputs: Shape (N, n).
        targets: Shape (N, m).
        ridge: Of collinear inputs (a gait makes all joints nearly so), not of noise; at least 0.
    """
    input_scaling, output_scaling = scaling(inputs), scaling(targets)
    z, y = input_scaling.apply(inputs), output_scaling.apply(targets)
    square = z.T @ z / len(z) + ridge * np.eye(z.shape[1])
    weight = np.linalg.solve(square, z.T @ y / len(z)).T
    return unscale([(weight, np.zeros(targets.shape[1]))], input_scaling, output_scaling)


def with_spread(network: Network, inputs: np.ndarray, targets: np.ndarray) -> Network:
    """Return a linear model as a Gaussian: its standard deviations are those of its residuals, the same everywhere."""
    (weight, bias) = network.layers[0]
    sd = np.maximum((targets - network.predict_many(inputs)).std(axis=0), SMALLEST)
    return Network([(np.vstack([weight, np.zeros_like(weight)]), np.concatenate([bias, np.log(sd)]))])
