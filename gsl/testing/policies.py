"""What a policy promises: named parameters, a posture, and actions that follow from what it has seen in the episode."""

from __future__ import annotations

import numpy as np

from gsl.core.interfaces import Policy, World
from gsl.testing.components import check_component, require
from gsl.testing.episodes import WORLD, observe

TICKS = 25


def check_policy(policy: Policy, *, world: World = WORLD) -> None:
    """Check a policy.

    Args:
        policy: A family of policies.
        world: Whose observations it takes; the NAO on the ground by default.
    """
    check_component(policy)
    require(policy, isinstance(policy, Policy), "needs `names`, `initial`, `scale`, `posture` and `start`")
    names, initial, scale = policy.names, np.asarray(policy.initial), np.asarray(policy.scale)
    require(policy, len(set(names)) == len(names), "two parameters have one name")
    require(policy, initial.shape == scale.shape == (len(names),), "has not as many start values and scales as names")
    require(policy, bool(np.isfinite(initial).all()), "has a start value that is not finite")
    require(policy, bool((scale > 0.0).all() and np.isfinite(scale).all()), "has a scale that is not positive")
    layout = world.layout
    posture, n = np.asarray(policy.posture(initial, layout)), len(layout.joints)
    require(policy, posture.shape in ((n,), (0,)), f"its posture has the shape {posture.shape}, not ({n},)")
    observations = observe(world, TICKS, posture if len(posture) else None)
    first, second = (_act(policy, initial, world, observations) for _ in range(2))
    require(policy, bool(np.isfinite(first).all()), "returns an action that is not finite")
    require(policy, np.array_equal(first, second), "acts otherwise in another episode that shows it the same")


def _act(policy: Policy, parameters: np.ndarray, world: World, observations: np.ndarray) -> np.ndarray:
    run, actions, n = policy.start(parameters, world.layout), [], len(world.layout.joints)
    for observation in observations:
        seen = observation.copy()
        action = np.asarray(run.act(seen), dtype=float)
        require(policy, np.array_equal(seen, observation), "changes the observation that it is given")
        require(policy, action.shape == (n,), f"returns an action of shape {action.shape}, not ({n},)")
        actions.append(action.copy())
    return np.array(actions)
