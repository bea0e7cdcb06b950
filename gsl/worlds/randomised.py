"""A world that is another one in every episode: Bullet with effects that are drawn anew at each reset."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np

from gsl.core.layout import Layout
from gsl.effects.effect import together
from gsl.worlds.bullet import BulletWorld

_STREAM = 11  # sets the draw's randomness apart from that of the world, whose seed is the same
Draw = Callable[[np.random.Generator], Mapping[str, Any]]


@dataclass(frozen=True)
class RandomisedWorld:
    """What is drawn, on top of what; it can be pickled.

    Attributes:
        world: As it is without a draw.
        draw: Gives an `effects:` mapping, another one at every call.
    """

    world: BulletWorld
    draw: Draw

    @property
    def layout(self) -> Layout:
        """What an observation holds."""
        return self.world.layout

    def make(self) -> RandomisedEnv:
        """Build the environment."""
        return RandomisedEnv(self)


class RandomisedEnv(gymnasium.Env):
    """Every `reset` draws effects with its seed and builds the world anew."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  gymnasium's own name and type

    def __init__(self, made: RandomisedWorld) -> None:
        self._made, self._env = made, made.world.make()
        self.layout, self.action_space = made.layout, self._env.action_space
        self.observation_space = self._env.observation_space

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, bool]]:
        """Start anew in another world; arguments as those of `BulletEnv.reset`."""
        super().reset(seed=seed)
        rng = self.np_random.spawn(1)[0] if seed is None else np.random.default_rng([seed, _STREAM])
        world = self._made.world
        drawn = replace(world, effects=together([world.effects, self._made.draw(rng)]))
        self._env.close()
        self._env = drawn.make()
        return self._env.reset(seed=seed, options=options)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, bool]]:
        """Act in this episode's world."""
        return self._env.step(action)

    def close(self) -> None:
        """Free Bullet's client."""
        self._env.close()
