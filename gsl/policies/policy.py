"""What a policy is: a vector of parameters with names and scales, a start posture, and a pure way to act."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from gsl.core.layout import Layout
from gsl.worlds.world import World


class PolicyRun(Protocol):
    """A policy in one episode."""

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Return desired joint positions [rad], shape (n_joints,)."""


@runtime_checkable
class Policy(Protocol):
    """A family of policies; one member is a parameter vector."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""

    @property
    def initial(self) -> np.ndarray:
        """The parameters of π0."""

    @property
    def scale(self) -> np.ndarray:
        """Size of a step in each parameter that is as bold as in any other."""

    def posture(self, parameters: np.ndarray, layout: Layout) -> np.ndarray:
        """Return the joint positions where an episode starts [rad], shape (n_joints,); empty without joints."""

    def start(self, parameters: np.ndarray, layout: Layout) -> PolicyRun:
        """Return the policy at the beginning of an episode."""


@runtime_checkable
class Sized(Protocol):
    """A policy with as many parameters as a world has states and actions."""

    def sized(self, layout: Layout) -> Policy:
        """Return the policy for a world."""


def sized(policy: Policy, world: World) -> Policy:
    """Return a policy that knows its world, if it has to; only then has the world to say what it observes."""
    return policy.sized(world.layout) if isinstance(policy, Sized) else policy


def neighbour(policy: Policy, parameters: np.ndarray, spread: float, rng: np.random.Generator) -> np.ndarray:
    """Return parameters near others: each moved by a Gaussian of `spread` times its scale."""
    return parameters + spread * policy.scale * rng.standard_normal(len(parameters))
