"""A policy of a world of few states: one action a state."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np

from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.errors import ConfigError


@component
class ActionTable:
    """Its parameters are numbers of actions; π0 takes the same everywhere."""

    action: Annotated[int, setting("action of π0", ge=0)] = 0
    sizes: Annotated[tuple[int, int], setting("states and actions; by default the world's")] = (0, 0)

    def size_for(self, layout: Layout) -> ActionTable:
        """Return the policy for a world.

        Raises:
            ConfigError: Its states or actions cannot be counted, or π0's action does not exist.
        """
        if not (layout.cells and layout.choices):
            raise ConfigError("policy", "needs a world whose states and actions are discrete")
        if self.action >= layout.choices:
            raise ConfigError("policy.action", f"the world has {layout.choices} actions", given=str(self.action))
        return replace(self, sizes=(layout.cells, layout.choices))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return tuple(f"action_in_{state}" for state in range(self.sizes[0]))

    @property
    def initial(self) -> np.ndarray:
        """The parameters of π0, shape (n_states,)."""
        return np.full(len(self.names), float(self.action))

    @property
    def scale(self) -> np.ndarray:
        """Size of a step in each parameter: a neighbour takes other actions where chance moves it by a half."""
        return np.ones(len(self.names))

    def posture(self, parameters: np.ndarray, layout: Layout) -> np.ndarray:
        """Return nothing: the environment has its own start."""
        return np.zeros(0)

    def start(self, parameters: np.ndarray, layout: Layout) -> ActionTableRun:
        """Return the policy at the beginning of an episode."""
        last = layout.choices - 1
        return ActionTableRun(np.clip(np.round(np.asarray(parameters, dtype=float)), 0, last))


class ActionTableRun:
    """The table in one episode."""

    def __init__(self, actions: np.ndarray) -> None:
        self._actions = actions

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Return the number of the action, shape (1,)."""
        return self._actions[int(observation[0]) : int(observation[0]) + 1]
