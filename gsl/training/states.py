"""Both models of worlds whose state is a vector or one of few: what the training stages do with logs of such worlds."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gsl.core.scaling import Scaling
from gsl.core.trajectory import Batch
from gsl.errors import ConfigError
from gsl.models.calibration import mixing
from gsl.models.choice import best, fit_network
from gsl.models.config import ModelConfig
from gsl.models.counts import Counts, count_transitions
from gsl.models.head import POINT, Head
from gsl.models.network import Network, Samples, unscale
from gsl.models.states import NearestChoice, StateForward, StateInverse, encode
from gsl.storage.models import write_model
from gsl.training.data import Parts, compute_r2, summary

ROUNDING = 1e-9  # of the largest value, below which a spread is rounding


class Steps(NamedTuple):
    """One row a step.

    Attributes:
        states: Shape (N, n_states).
        actions: Carried out, shape (N, n_actions).
        changes: Of the variables of interest, shape (N, n_variables).
    """

    states: np.ndarray
    actions: np.ndarray
    changes: np.ndarray


def forward_of_states(folder: Path, data: Parts, config: ModelConfig, seed: int) -> Mapping[str, Any]:
    """Write a forward model of the real world, and return its errors on held-out trajectories.

    Raises:
        ConfigError: The model is to be something that is for robots alone.
    """
    refuse_robots(config, "model")
    if few(data.training):
        return _counts(folder, data, "forward_model")
    model, choice = best(config, partial(_forward, data=data, seed=seed), partial(_score, data=data))
    write_model(folder, model)
    rows = _steps(data.heldout, model.variables)
    errors = model.changes(rows.states, rows.actions) - rows.changes
    measured = {"steps": len(errors), "r2": compute_r2(errors / model.scale, rows.changes / model.scale)}
    if model.head.draws:
        measured["nll"] = _nll(model, rows)
    by_variable = {
        str(variable): compute_r2(errors[:, [k]], rows.changes[:, [k]]) for k, variable in enumerate(model.variables)
    }
    heldout = {**measured, "r2_by_variable": by_variable}
    return {**summary(choice, data), "space": StateForward.space, "heldout": heldout}


def inverse_of_states(folder: Path, data: Parts, config: ModelConfig, seed: int) -> Mapping[str, Any]:
    """Write an inverse model of the simulator, and return how well it recovers held-out actions.

    Raises:
        ConfigError: The model is to be something that is for robots alone.
    """
    refuse_robots(config, "model")
    if few(data.training):
        return _counts(folder, data, "inverse_model")
    choices, make = data.training.metadata.get("choices", 0), _nearest if _choices(data) else _inverse
    model, choice = best(config, partial(make, data=data, seed=seed), partial(_recovery, data=data.validation))
    write_model(folder, model)
    about = {"space": StateForward.space, "method": model.method}
    name = "recovered_choices" if choices else "action_r2"
    return {**summary(choice, data), **about, "heldout": {name: 1.0 - _recovery(model, data.heldout)}}


def few(batch: Batch) -> bool:
    """Whether states and actions of a batch are few enough to be counted."""
    return bool(batch.metadata.get("cells") and batch.metadata.get("choices"))


def refuse_robots(config: ModelConfig, where: str) -> None:
    """Refuse what is for robots alone; `where` is the setting that this configuration is."""
    usual = ModelConfig()
    for name in ("horizon", "members", "sensors", "multi_step"):
        if getattr(config, name) != getattr(usual, name):
            raise ConfigError(f"{where}.{name}", "is for robots; a gymnasium environment's state is observed whole")


def _counts(folder: Path, data: Parts, kind: str) -> Mapping[str, Any]:
    """Count all transitions but those held out: there is nothing whose fit has to be stopped."""
    sizes = data.training.metadata["cells"], data.training.metadata["choices"]
    parts = data.training, data.validation
    seen = sum(count_transitions(part.episodes, *sizes) for part in parts)
    assert isinstance(seen, np.ndarray)
    write_model(folder, Counts(seen, kind))
    visited = float((seen.sum(axis=2) > 0).mean())
    return {"space": Counts.space, "trajectories": sum(map(len, parts)), "steps": int(seen.sum()), "visited": visited}


def _choices(data: Parts) -> int:
    return int(data.training.metadata.get("choices", 0))


def _steps(batch: Batch, variables: tuple[int, ...]) -> Steps:
    states = [episode.state for episode in batch.episodes if episode.state is not None]
    sent = [
        episode.action if episode.grounded_action is None else episode.grounded_action for episode in batch.episodes
    ]
    if not batch.metadata.get("choices"):
        sent = [np.clip(actions, -1.0, 1.0) for actions in sent]  # as the environment carries them out
    changes = [np.diff(state, axis=0)[:, variables] for state in states]
    return Steps(np.concatenate([state[:-1] for state in states]), np.concatenate(sent), np.concatenate(changes))


def _forward(config: ModelConfig, whole: bool, *, data: Parts, seed: int, head: Head | None = None) -> StateForward:
    choices, variables = _choices(data), config.of_interest(data.training.states, "model")
    seen, unseen = (_steps(part, variables) for part in (data.training, data.validation))
    head = config.head if head is None else head
    training, validation = (
        (np.hstack([part.states, encode(part.actions, choices)]), part.changes) for part in (seen, unseen)
    )
    network = _fit(training, validation, config, seed, whole, head)
    scale = np.maximum(seen.changes.std(axis=0), 1e-12)
    actions = choices or seen.actions.shape[1]
    full = head.likelihood == "gaussian" and config.covariance == "full"
    together = mixing(network, head, validation) if full else None
    return StateForward(network, head, data.training.states, actions, choices, variables, scale, together)


def _inverse(config: ModelConfig, whole: bool, *, data: Parts, seed: int) -> StateInverse:
    variables = config.of_interest(data.training.states, "model")
    seen, unseen = (_invert(_steps(part, variables)) for part in (data.training, data.validation))
    network = _fit(seen, unseen, config, seed, whole)
    return StateInverse(network, data.training.states, seen[1].shape[1], variables)


def _fit(
    training: Samples, validation: Samples, config: ModelConfig, seed: int, whole: bool, head: Head = POINT
) -> Network:
    """Return a network that was fitted in units of each column's own spread; what never changes stays as it is."""
    input_scaling, output_scaling = (_own_units(values) for values in training)
    seen, unseen = ((input_scaling.apply(x), output_scaling.apply(y)) for x, y in (training, validation))
    network = fit_network(seen, unseen, config, seed=seed, head=head, whole=whole)
    return unscale([(weight, bias) for weight, bias in network.layers], input_scaling, head.scaling(output_scaling))


def _own_units(values: np.ndarray) -> Scaling:
    sd = values.std(axis=0)
    return Scaling(values.mean(axis=0), np.where(sd > ROUNDING * np.abs(values).max(axis=0), sd, 1.0))


def _nearest(config: ModelConfig, whole: bool, *, data: Parts, seed: int) -> NearestChoice:
    return NearestChoice(_forward(config, whole, data=data, seed=seed, head=POINT))


def _invert(steps: Steps) -> Samples:
    return np.hstack([steps.states, steps.changes]), steps.actions


def _score(model: StateForward, data: Parts) -> float:
    rows = _steps(data.validation, model.variables)
    if model.head.draws:
        return _nll(model, rows)
    return float(np.mean(np.square((model.changes(rows.states, rows.actions) - rows.changes) / model.scale)))


def _nll(model: StateForward, rows: Steps) -> float:
    """The negative log likelihood of a variable's change, in units of its usual size [nats]."""
    raw = model.network.predict_many(np.hstack([rows.states, model.encode(rows.actions)]))
    each = model.head.surprise(raw, rows.changes) / rows.changes.shape[1]
    return float(each.mean() - np.log(model.scale).mean())


def _recovery(model: StateInverse | NearestChoice, data: Batch) -> float:
    """The share of actions that is not recovered: of choices the wrong ones, else of the variance."""
    rows = _steps(data, model.variables)
    actions = model.actions_for(rows.states, rows.changes)
    if isinstance(model, NearestChoice):
        return float(np.mean(actions != rows.actions))
    return 1.0 - compute_r2(actions - rows.actions, rows.actions)
