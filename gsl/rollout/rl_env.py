"""The grounded simulator as a learner sees it: an environment that rewards what the task rewards, or a table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from gsl.core.layout import Layout
from gsl.core.table import Table
from gsl.errors import ConfigError
from gsl.grounding.none import NoGrounding
from gsl.grounding.states import TableTransformation
from gsl.rollout.rollout import Scenario
from gsl.worlds.gymnasium import GymnasiumWorld


@dataclass(frozen=True)
class GroundedSimulator:
    """A scenario for learners.

    Attributes:
        scenario: With a grounding that is ready to act.
        parameters: Of π0, shape (n_parameters,): its posture is where a robot starts.
    """

    scenario: Scenario
    parameters: np.ndarray

    @property
    def layout(self) -> Layout:
        """What an observation holds, and what an action is."""
        return self.scenario.world.layout

    def env(self) -> gymnasium.Env:
        """Return a gymnasium environment."""
        return RewardedEnv(self.scenario, self.parameters)

    def table(self) -> Table:
        """Return all transitions and rewards.

        Raises:
            ConfigError: They are not known, or the grounding does not act on tables.
        """
        world, grounding = self.scenario.world, self.scenario.grounding
        if not isinstance(world, GymnasiumWorld):
            raise ConfigError("optimizer", "policy iteration needs a world of few states, with a table P")
        if isinstance(grounding, TableTransformation):
            return grounding.ground(world.table)
        if not isinstance(grounding, NoGrounding):
            raise ConfigError("grounding", "policy iteration knows none, gat and sgat only")
        return world.table


class RewardedEnv(gymnasium.Env):
    """A scenario as an environment that any library for reinforcement learning can act in; it tells no `info`."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  gymnasium's own name and type

    def __init__(self, scenario: Scenario, parameters: np.ndarray) -> None:
        self._scenario, self._env, self._layout = scenario, scenario.make(), scenario.world.layout
        self._posture = scenario.policy.posture(parameters, self._layout)
        self.observation_space = self._env.observation_space
        choices = self._layout.choices
        self.action_space = gymnasium.spaces.Discrete(choices) if choices else _single(self._env.action_space)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode; without a seed, one that an earlier seed leads to."""
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(2**31))
        self._seen, _ = self._env.reset(seed=drawn, options={"posture": self._posture})
        self._task = self._scenario.task.start(self._layout, self._seen, self._scenario.role)
        self._left = self._scenario.ticks
        return self._seen, {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Act; the reward is the task's."""
        before, sent = self._seen, np.atleast_1d(np.asarray(action, dtype=float))
        self._seen, own, ended, cut, _ = self._env.step(sent)
        judged = self._task.step(before, self._seen, ended)
        self._left -= 1
        reward = own if judged.reward is None else judged.reward
        return self._seen, float(reward), ended or judged.ended, cut or self._left == 0, {}

    def close(self) -> None:
        """Free the world."""
        self._env.close()


def _single(space: gymnasium.Space[Any]) -> gymnasium.Space[Any]:
    """Return bounds in single precision, which learners have their actions in."""
    assert isinstance(space, gymnasium.spaces.Box), "actions that are no choices have bounds"
    return gymnasium.spaces.Box(space.low.astype(np.float32), space.high.astype(np.float32), dtype=np.float32)
