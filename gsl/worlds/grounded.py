"""A grounded world: an environment whose actions pass through a grounding on their way in."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from gsl.core.interfaces import Grounding
from gsl.core.layout import Layout
from gsl.core.seeds import grounding_generator


class GroundedEnv(gymnasium.Wrapper):
    """The agent acts, the world gets the grounded action, `info["grounded_action"]` tells it [rad], shape (n_joints,).

    Args:
        env: Has a `layout`.
        grounding: Starts anew with every episode.
    """

    def __init__(self, env: gymnasium.Env, grounding: Grounding) -> None:
        super().__init__(env)
        self.layout: Layout = env.get_wrapper_attr("layout")
        self._grounding, self._rng = grounding, np.random.default_rng()
        self._charged = getattr(env, "charged", None)  # where a reward charges for actions

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start anew; `seed` is of the world and of the grounding."""
        if seed is not None:
            self._rng = grounding_generator(seed)
        self._seen, info = self.env.reset(seed=seed, options=options)
        self._run = self._grounding.start(self.layout, self._rng)
        return self._seen, info

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Send the grounded action."""
        sent = self._run.transform(self._seen, action)
        self._seen, reward, ended, cut, info = self.env.step(sent)
        if self._charged and sent is not action:
            reward = self._charged.correct(float(reward), action, sent, info)
        return self._seen, float(reward), ended, cut, {**info, "grounded_action": sent}
