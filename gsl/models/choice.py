"""Fitting the families that a configuration allows and choosing among them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np

from gsl.core.interruption import held
from gsl.models.config import ModelConfig
from gsl.models.head import POINT, Head
from gsl.models.linear import fit_linear, with_spread
from gsl.models.network import Network, Samples

M = TypeVar("M")


class Choice(NamedTuple):
    """The best variant of a configuration, and the score of every one that was tried, less is better."""

    config: ModelConfig
    scores: dict[str, float]


def fit_network(
    training: Samples, validation: Samples, config: ModelConfig, *, seed: int, head: Head = POINT
) -> Network:
    """Return a network of one family.

    The linear one needs no early stopping and learns from all samples, but for those that are to calibrate its spread.
    """
    if config.family == "linear":
        both = (np.concatenate(pair) for pair in zip(training, validation, strict=True))
        inputs, targets = training if head.draws else both
        network = fit_linear(inputs, targets, ridge=config.ridge)
        return with_spread(network, inputs, targets) if head.draws else network
    with held():
        from gsl.models.fitting import fit_mlp

    return fit_mlp(training, validation, config, seed=seed, head=head)


def best(config: ModelConfig, fit: Callable[[ModelConfig], M], score: Callable[[M], float]) -> tuple[M, Choice]:
    """Fit every variant and return the model with the least score; at a tie the simpler one."""
    variants = config.variants
    models = {name: fit(variant) for name, variant in variants.items()}
    scores = {name: score(model) for name, model in models.items()}
    name = min(scores, key=lambda one: scores[one])
    return models[name], Choice(variants[name], scores)
