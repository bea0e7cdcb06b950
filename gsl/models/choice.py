"""Fitting the families that a configuration allows and choosing among them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np

from gsl.core.interruption import hold_interrupts
from gsl.models.config import ModelConfig
from gsl.models.free_run import Segments
from gsl.models.head import POINT, Head
from gsl.models.linear import fit_linear, with_spread
from gsl.models.network import Network, Samples

M = TypeVar("M")


class Choice(NamedTuple):
    """The best variant of a configuration, and the score of every one that was tried, less is better."""

    config: ModelConfig
    scores: dict[str, float]


def fit_network(
    training: Samples,
    validation: Samples,
    config: ModelConfig,
    *,
    seed: int,
    head: Head = POINT,
    whole: bool = False,
    pieces: tuple[Segments, Segments] | None = None,
) -> Network:
    """Return a network of one family; validation stops the fit of an MLP, and a linear one learns from the `whole`.

    An MLP's fit goes on with the multi-step loss on `pieces` of both, if there are any.
    """
    if config.family == "linear":
        inputs, targets = map(np.concatenate, zip(training, validation, strict=True)) if whole else training
        network = fit_linear(inputs, targets, ridge=config.ridge)
        return with_spread(network, inputs, targets) if head.draws else network
    with hold_interrupts():
        from gsl.models.fitting import fit_mlp

    return fit_mlp(training, validation, config, seed=seed, head=head, pieces=pieces)


def best(config: ModelConfig, fit: Callable[[ModelConfig, bool], M], score: Callable[[M], float]) -> tuple[M, Choice]:
    """Fit every variant and return the model with the least score; at a tie the simpler one.

    Args:
        config: What is allowed.
        fit: Of a variant, to the training samples alone, or if it is told so to those of the validation as well.
        score: Of a model on validation trajectories. All that are compared have been fitted without them; the one that
            is chosen learns from them too, if nothing else needs them.
    """
    variants = config.variants
    models = {name: fit(variant, False) for name, variant in variants.items()}
    scores = {name: score(model) for name, model in models.items()}
    name = min(scores, key=lambda variant: scores[variant])
    chosen = variants[name]
    return fit(chosen, True) if chosen.learns_from_all else models[name], Choice(chosen, scores)
