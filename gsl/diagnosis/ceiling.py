"""The ceiling: how much of the held-out gap a learned residual takes away, with no physics and the same data.

The model of GAT's forward model (linear or MLP, whichever does better on a part of the training windows) predicts from
the last simulated positions and commands how far the robot is from the simulator.
"""

from __future__ import annotations

import numpy as np

from gsl.diagnosis.experiment import Experiment
from gsl.models.choice import best, fit_network
from gsl.models.config import ModelConfig
from gsl.models.network import Network, Samples

LAGS = (0, 1, 2, 3, 5, 8, 12)  # ticks back at which the model sees command less position
CONFIG = ModelConfig(hidden=(64, 64), epochs=40, patience=6, ridge=1.0)
VALIDATION = 4  # every fourth training window
CLIP = 50.0  # of the targets, in units of the floor


def learned_residual(found: Experiment, told: np.ndarray, *, seed: int = 0) -> np.ndarray:
    """Return held-out residuals after the learned correction, in units of the floor, shape (W, scored, n_joints).

    Args:
        found: The log.
        told: What the simulator says to all windows [rad], shape (W, T, n_joints).
        seed: Of the fit.
    """
    inputs, targets = _samples(found, told)
    train, check = found.train[np.arange(len(found.train)) % VALIDATION > 0], found.train[::VALIDATION]
    sets = _flat(inputs[train], targets[train]), _flat(inputs[check], targets[check])

    def fit(config: ModelConfig, whole: bool) -> Network:
        return fit_network(*sets, config, seed=seed, whole=whole)

    def score(network: Network) -> float:
        return float(np.mean((network.predict_many(sets[1][0]) - sets[1][1]) ** 2))

    network, _ = best(CONFIG, fit, score)
    z = -targets[found.held_out]
    return z + network.predict_many(inputs[found.held_out].reshape(-1, inputs.shape[2])).reshape(z.shape)


def _samples(found: Experiment, told: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return inputs, shape (W, scored, n_inputs), and what is to be predicted, shape (W, scored, n_joints)."""
    cut, first = found.pieces, found.pieces.warm_up
    joints = len(found.joints)
    commands = cut.windows.commands[:, : told.shape[1], :joints][:, ::-1]
    behind = commands - told[..., :joints]
    lagged = [behind[:, first - lag : behind.shape[1] - lag] for lag in LAGS if lag <= first]
    speed = np.gradient(told, axis=1)[:, first:]
    targets = np.clip((cut.real - told) / found.comparison.floor, -CLIP, CLIP)[:, first:]
    place = told[:, first:] - np.where(np.arange(told.shape[2]) < joints, 0.0, told[:, first : first + 1])
    return np.concatenate([*lagged, speed, place, np.sign(speed)], axis=2), targets


def _flat(inputs: np.ndarray, targets: np.ndarray) -> Samples:
    return inputs.reshape(-1, inputs.shape[2]), targets.reshape(-1, targets.shape[2])
