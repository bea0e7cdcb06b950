"""Fitting the families that a configuration allows and choosing among them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np

from gsl.models.config import ModelConfig
from gsl.models.head import POINT, Head
from gsl.models.linear import fit_linear, with_spread
from gsl.models.network import Network, Samples

M = TypeVar("M")


class Choice(NamedTuple):
    """The score of every family that was tried, less is better, and the best one."""

    family: str
    scores: dict[str, float]


def fit_network(
    family: str, training: Samples, validation: Samples, config: ModelConfig, *, seed: int, head: Head = POINT
) -> Network:
    """Return a network of one family; the linear one, which needs no early stopping, learns from all samples."""
    if family == "linear":
        inputs, targets = (np.concatenate(both) for both in zip(training, validation, strict=True))
        network = fit_linear(inputs, targets, ridge=config.ridge)
        return with_spread(network, inputs, targets) if head.draws else network
    from gsl.models.fitting import fit_mlp

    return fit_mlp(training, validation, config, seed=seed, head=head)


def best(config: ModelConfig, fit: Callable[[str], M], score: Callable[[M], float]) -> tuple[M, Choice]:
    """Fit every family and return the model with the least score; at a tie the simpler one."""
    models = {family: fit(family) for family in config.families}
    scores = {family: score(model) for family, model in models.items()}
    family = min(scores, key=lambda name: scores[name])
    return models[family], Choice(family, scores)
