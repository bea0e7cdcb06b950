"""No grounding: the simulator as it is."""

from __future__ import annotations

import numpy as np

from gsl.core.layout import Layout
from gsl.core.setting import component


@component
class NoGrounding:
    """Sends the agent's actions."""

    def start(self, layout: Layout, rng: np.random.Generator) -> NoGrounding:
        """Return the grounding at the beginning of an episode."""
        return self

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        """Return the action."""
        return action
