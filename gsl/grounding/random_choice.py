"""Action noise where an action is a choice: now and then another one, drawn uniformly from all."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.grounding.ane import ActionNoise


def exploration(size: float, layout: Layout) -> ActionNoise | RandomChoice:
    """Return the noise that trajectories are collected with: a standard deviation, or of choices a chance."""
    return RandomChoice(size) if layout.choices else ActionNoise(sd=size)


@component
class RandomChoice:
    """Replaces the agent's action with a chance."""

    chance: Annotated[float, setting("chance in every step", ge=0, le=1)] = 0.1

    def start(self, layout: Layout, rng: np.random.Generator) -> RandomChoiceRun:
        """Return the grounding at the beginning of an episode.

        Raises:
            ConfigError: Actions are numbers, not choices.
        """
        if not layout.choices:
            raise ConfigError("grounding", "is for worlds whose actions are choices; ane is for numbers")
        return RandomChoiceRun(self.chance, layout.choices, rng)


class RandomChoiceRun:
    """The noise in one episode."""

    def __init__(self, chance: float, choices: int, rng: np.random.Generator) -> None:
        self._chance, self._choices, self._rng = chance, choices, rng

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        """Return the action, or another one."""
        if self._rng.random() >= self._chance:
            return action
        return np.array([float(self._rng.integers(self._choices))])
