"""Fitting a forward model of a robot to trajectories, and its errors on others."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from gsl.core.angles import encode
from gsl.core.seeds import derive_seed
from gsl.core.trajectory import Trajectory
from gsl.core.transitions import Transitions, transitions, usable
from gsl.models.calibration import calibrate
from gsl.models.choice import Choice, best, fit_network
from gsl.models.config import ModelConfig
from gsl.models.ensemble import Forward, ensemble
from gsl.models.forward import ForwardModel
from gsl.models.free_run import Segments, predict_error, segments, shortest, standstill_error
from gsl.models.network import Samples
from gsl.training.data import (
    Parts,
    compute_r2,
    degrees,
    degrees_by_joint,
    of_policy,
)


def fit_forward(
    config: ModelConfig, data: Parts, seed: int, base: ForwardModel | None = None
) -> tuple[Forward, Choice]:
    """Return the forward model that a configuration allows and that does best on validation trajectories.

    Args:
        config: What is allowed.
        data: To learn from.
        seed: Of the fit.
        base: What is corrected, none for a robot learned from nothing.
    """
    judges = long_enough(config, of_policy(data.validation, pi0=False)) or long_enough(config, data.validation.episodes)
    return best(
        config, lambda variant, whole: _fit(variant, data, seed, base, whole), lambda model: _score(model, judges)
    )


def _fit(config: ModelConfig, data: Parts, seed: int, base: ForwardModel | None, whole: bool) -> Forward:
    episodes = data.training.episodes
    if config.members == 1:
        return _member(config, episodes, data, seed, base, whole)
    rng = np.random.default_rng(derive_seed(seed, "members"))
    drawn = [rng.integers(len(episodes), size=len(episodes)) for _ in range(config.members)]
    members = [
        _member(config, [episodes[index] for index in indices], data, seed + number, base)
        for number, indices in enumerate(drawn)
    ]
    return ensemble(tuple(members), model_rows(config, data.validation.episodes).windows)


def _score(model: Forward, episodes: Sequence[Trajectory]) -> float:
    measured = forward_errors(model, episodes)
    if model.head.draws:
        return float(measured["nll"])
    return float(measured["free_run_deg"] if model.horizon == 1 else measured["one_step_deg"])


def long_enough(config: ModelConfig, episodes: Sequence[Trajectory]) -> tuple[Trajectory, ...]:
    """Return the episodes that are long enough to measure a model by."""
    needed = shortest(config.of_body, config.horizon)
    return tuple(episode for episode in episodes if usable(episode) >= needed)


def _member(
    config: ModelConfig,
    episodes: Sequence[Trajectory],
    data: Parts,
    seed: int,
    base: ForwardModel | None,
    whole: bool = False,
) -> ForwardModel:
    """Return a model of some of the training trajectories, and of those of the validation if it is the `whole`."""
    head = config.head
    seen, unseen = (_samples(config, part, base) for part in (episodes, data.validation.episodes))
    pieces = _pieces(config, episodes, data.validation.episodes) if config.multi_step > 1 else None
    network = fit_network(seen, unseen, config, seed=seed, head=head, whole=whole, pieces=pieces)
    memory = np.zeros(unseen[1].shape[1])
    if head.draws and config.calibrated:
        network, memory = calibrate(
            network, head, [_samples(config, [episode], base) for episode in data.validation.episodes]
        )
    joints = data.training.joints
    return ForwardModel(
        network, config.of_body, joints, config.encoding, config.horizon, head, memory, base, config.multi_step
    )


def _samples(config: ModelConfig, episodes: Sequence[Trajectory], base: ForwardModel | None) -> Samples:
    rows = model_rows(config, episodes)
    baseline = 0.0 if base is None else base.effects(rows.windows[:, : base.network.inputs])
    return rows.windows, encode(rows.change - baseline, config.encoding)


def _pieces(config: ModelConfig, *parts: Sequence[Trajectory]) -> tuple[Segments, Segments] | None:
    """Return what the multi-step loss is of in both parts; None where all of a member's draw are over too soon."""
    needed = config.of_body.span + config.multi_step + 1
    training, validation = ([episode for episode in part if usable(episode) >= needed] for part in parts)
    if not training or not validation:
        return None
    cut = partial(segments, history=config.of_body, carried_out=True, ticks=config.multi_step, every=1)
    return cut(training), cut(validation)


def model_rows(config: ModelConfig, episodes: Sequence[Trajectory]) -> Transitions:
    """Return what a model of a configuration sees of some episodes, one row a control step."""
    return transitions(episodes, config.of_body, config.horizon, carried_out=True)


def forward_errors(model: Forward, episodes: Sequence[Trajectory]) -> dict[str, Any]:
    """Return the errors of a forward model on trajectories, beside those of "nothing changes" [degrees]."""
    data = transitions(episodes, model.history, model.horizon, carried_out=True)
    pieces = segments(episodes, model.history, carried_out=True)
    errors = model.effects(data.windows) - data.change
    measured = {
        "trajectories": len(episodes),
        "one_step_deg": degrees(errors),
        "one_step_no_change_deg": degrees(data.change),
        "r2": compute_r2(errors, data.change),
        "one_step_by_joint_deg": degrees_by_joint(errors, model.joints),
        "free_run_no_change_deg": degrees(standstill_error(pieces)),
    }
    if model.head.draws:
        measured["nll"] = float(model.surprise(data.windows, data.change).mean())
    if model.horizon == 1:
        ahead = predict_error(model, pieces)
        measured |= {"free_run_deg": degrees(ahead), "free_run_by_joint_deg": degrees_by_joint(ahead, model.joints)}
    return measured
