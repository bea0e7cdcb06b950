"""Policies that take their size from a world, and neighbours of a policy."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from gsl.core.interfaces import Policy, World
from gsl.core.layout import Layout
from gsl.core.setting import settings_of
from gsl.errors import ConfigError


@runtime_checkable
class Sized(Protocol):
    """A policy with as many parameters as a world has states and actions."""

    def size_for(self, layout: Layout) -> Policy:
        """Return the policy for a world."""


def size(policy: Policy, world: World) -> Policy:
    """Return a policy that knows its world, if it has to; only then has the world to say what it observes."""
    return policy.size_for(world.layout) if isinstance(policy, Sized) else policy


def size_to_search(policy: Policy, world: World) -> Policy:
    """Return a policy that knows its world and has something that a search can change.

    Raises:
        ConfigError: It has no parameters.
    """
    sized = size(policy, world)
    if not len(sized.names):
        problem = (
            "has no parameters that a search could change, since it makes choices; take policy=sb3 for its weights"
        )
        raise ConfigError("policy", problem, given=type(policy).__name__)
    return sized


def neighbour(policy: Policy, parameters: np.ndarray, spread: float, rng: np.random.Generator) -> np.ndarray:
    """Return parameters near others: each moved by a Gaussian of `spread` times its scale."""
    return parameters + spread * policy.scale * rng.standard_normal(len(parameters))


def describe_command(policy: Policy) -> list[str]:
    """Return what a policy is asked to do in words: its family, and each number that has a unit and is not 0."""
    settings = settings_of(type(policy)).values()
    numbers = [(item.name, getattr(policy, item.name, None), item.unit) for item in settings if item.unit]
    asked = [f"{name} {value:g} {unit}" for name, value, unit in numbers if isinstance(value, int | float) and value]
    return [type(policy).__module__.rpartition(".")[2], *asked]
