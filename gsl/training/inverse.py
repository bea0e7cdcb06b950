"""Fitting an inverse model of a simulator to trajectories: the action by regression, or a model to solve for it."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from gsl.core.angles import encode
from gsl.core.setting import setting
from gsl.core.trajectory import Batch
from gsl.core.transitions import Transitions, transitions
from gsl.models.choice import Choice, best, fit_network
from gsl.models.config import ModelConfig
from gsl.models.forward import ForwardModel
from gsl.models.free_run import recover_error, segments
from gsl.models.inverse import InverseModel, Regression, Solver
from gsl.models.linear import fit_linear
from gsl.models.network import Samples
from gsl.training.data import Parts, degrees

Method = Annotated[
    Literal["regression", "solve"],
    setting("fit the action (the paper), or solve a model of the simulator for it, the identity where sim = real"),
]
Damping = Annotated[
    float, setting("of solve: what a change of action costs, in units of the squared sensitivity", gt=0, upper=1.0)
]


def fit_inverse(
    config: ModelConfig, data: Parts, seed: int, method: Method, damping: float
) -> tuple[InverseModel, Choice]:
    """Return the inverse model that a configuration allows and that best recovers the actions of validation."""
    pieces = segments(data.validation.episodes, config.of_joints, carried_out=True)

    def fit(variant: ModelConfig, whole: bool) -> InverseModel:
        if method == "regression":
            return _regression(variant, data, seed, whole)
        return _solver(variant, data, seed, damping, whole)

    return best(config, fit, lambda model: degrees(recover_error(model, pieces)))


def _regression(config: ModelConfig, data: Parts, seed: int, whole: bool) -> InverseModel:
    n = len(data.training.joints)
    seen, unseen = (_invert(_rows(config, part), n, config) for part in (data.training, data.validation))
    network = fit_network(seen, unseen, config, seed=seed, whole=whole)
    return Regression(network, config.of_joints, data.training.joints, config.encoding, config.horizon)


def _solver(config: ModelConfig, data: Parts, seed: int, damping: float, whole: bool) -> InverseModel:
    joints = data.training.joints
    rows = [_rows(config, part) for part in (data.training, data.validation)]
    seen, unseen = ((part.windows, encode(part.change, config.encoding)) for part in rows)
    network = fit_network(seen, unseen, config, seed=seed, whole=whole)
    simulator = ForwardModel(network, config.of_joints, joints, config.encoding, config.horizon)
    plain = fit_linear(rows[0].windows, rows[0].change, ridge=config.ridge)
    sensitivity = plain.layers[0][0][:, : len(joints)].astype(float)
    return Solver(simulator, sensitivity, damping)


def _invert(data: Transitions, n: int, config: ModelConfig) -> Samples:
    """Let the wanted change take the place of the action in the inputs, and the action become the target."""
    inputs = np.concatenate([data.change, data.windows[:, n:]], axis=1)
    return inputs, encode(data.windows[:, :n], config.encoding)


def _rows(config: ModelConfig, part: Batch) -> Transitions:
    return transitions(part.episodes, config.of_joints, config.horizon, carried_out=True)
