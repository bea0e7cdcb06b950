"""What a grounding is: a change of every action on its way into the simulator, so that it moves like the real robot."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from gsl.core.layout import Layout


class GroundingRun(Protocol):
    """A grounding in one episode; it remembers what it has seen and sent."""

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        """Return what to send instead of the agent's action [rad], shape (n_joints,)."""


@runtime_checkable
class Grounding(Protocol):
    """A way to change actions; it can be pickled."""

    def start(self, layout: Layout, rng: np.random.Generator) -> GroundingRun:
        """Return the grounding at the beginning of an episode, with its own source of randomness."""
