"""Worlds and rollouts that several tests use."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gsl.policies.walk_engine import WalkEngine
from gsl.worlds.bullet import BulletEnv, BulletWorld

STANCE = WalkEngine().posture(WalkEngine().initial, None)  # crouched, as the walk begins


def world(effects: Mapping[str, Any] | None = None, **settings: Any) -> BulletWorld:
    return BulletWorld(robot="nao", effects=effects or {}, **settings)


def held(effects: Mapping[str, Any] | None = None, **settings: Any) -> BulletWorld:
    """The robot in the air, without start noise."""
    return world(effects, floating=False, start_noise=0.0, **settings)


def walked(env: BulletEnv, seed: int, seconds: float, engine: WalkEngine | None = None, parameters=None) -> np.ndarray:
    """Observations of a walk from the first one to the last or to a fall, shape (T + 1, size)."""
    engine = engine or WalkEngine()
    parameters = engine.initial if parameters is None else parameters
    observation, _ = env.reset(seed=seed, options={"posture": engine.posture(parameters, env.layout)})
    policy, seen = engine.start(parameters, env.layout), [observation]
    for _ in range(round(seconds / env.layout.control_period)):
        observation, _, fell, _, _ = env.step(policy.act(observation))
        seen.append(observation)
        if fell:
            break
    return np.array(seen)


def followed(env: BulletEnv, actions: np.ndarray, seed: int = 0) -> np.ndarray:
    """Observations while `actions` are issued, starting at rest in the first one, shape (T + 1, size)."""
    observation, _ = env.reset(seed=seed, options={"posture": actions[0]})
    return np.array([observation, *(env.step(action)[0] for action in actions)])
