"""What a grounding promises: an action for an action, the same by the same seed, and models that come from evidence."""

from __future__ import annotations

from typing import Any

import numpy as np

from gsl.core.interfaces import Evidence, Grounding, Preparable, Trainable, World
from gsl.errors import ConfigError
from gsl.grounding.preparation import check_own
from gsl.testing.components import alike, check_component, require
from gsl.testing.episodes import WORLD, collect, observe

TICKS, SEED, SWING = 25, 3, 0.1  # SWING of the agent's actions about the measured positions [rad]


def check_grounding(grounding: Grounding, *, world: World = WORLD, evidence: Evidence | None = None) -> None:
    """Check a grounding; one that learns does so from `evidence`, one that needs artifacts has to name them.

    Args:
        grounding: Its settings.
        world: The simulator; the NAO on the ground by default.
        evidence: Trajectories; by default a few of `world`, which stands for both.
    """
    check_component(grounding)
    require(grounding, isinstance(grounding, Grounding), "needs `start`")
    ready: Any = grounding
    if isinstance(grounding, Preparable):
        grounding.check(world)
        world, ready = grounding.prepare(world, {})
    elif isinstance(grounding, Trainable):
        ready = _learn(grounding, world, evidence)
    observations = observe(world, TICKS)
    first, second = (_transform(ready, world, observations) for _ in range(2))
    require(grounding, bool(np.isfinite(first).all()), "sends an action that is not finite")
    require(grounding, np.array_equal(first, second), "sends something else in another episode of the same seed")


def _learn(grounding: Trainable, world: World, evidence: Evidence | None) -> Grounding:
    try:
        check_own(grounding)
    except ConfigError as error:
        raise AssertionError(f"{type(grounding).__name__}: {error.problem}") from error
    if evidence is None:
        batch = collect(world)
        evidence = Evidence(*(batch if role in grounding.needs else None for role in Evidence._fields))
    first, again = (
        {name: np.array(array) for name, array in grounding.learn(evidence, SEED).items()} for _ in range(2)
    )
    require(grounding, bool(first), "learns nothing")
    for name, array in first.items():
        numbers = np.issubdtype(array.dtype, np.number) or array.dtype == bool
        require(grounding, bool(numbers), f"learns {name}, which is no array of numbers")
        require(grounding, bool(np.isfinite(array).all()), f"learns {name} with a number that is not finite")
    require(grounding, alike(first, again), "learns something else from the same evidence and seed")
    loaded = grounding.load(first)
    require(grounding, isinstance(loaded, Grounding), "its load() returns nothing with `start`")
    return loaded


def _transform(grounding: Grounding, world: World, observations: np.ndarray) -> np.ndarray:
    run, n = grounding.start(world.layout, np.random.default_rng(SEED)), len(world.layout.joints)
    here, sent = world.layout["position"], []
    for k, observation in enumerate(observations):
        seen, action = observation.copy(), observation[here] + SWING * np.sin(0.3 * k + np.arange(n))
        copy = action.copy()
        changed = np.asarray(run.transform(seen, copy), dtype=float)
        require(grounding, changed.shape == (n,), f"sends an action of shape {changed.shape}, not ({n},)")
        same = np.array_equal(seen, observation) and np.array_equal(copy, action)
        require(grounding, same, "changes the observation or the action that it is given")
        sent.append(changed.copy())
    return np.array(sent)
