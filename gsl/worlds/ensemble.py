"""A world that is one of several simulators in every episode: which one, the seed of the reset says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from gsl.core.layout import Layout
from gsl.worlds.bullet import BulletEnv, BulletWorld

TURNS = 2**12  # the last bits of a seed say which member an episode is in


def take_turns(world: Any, seed: int, turn: int) -> int:
    """Return the seed of an episode that meets the next member of an ensemble at every turn; of other worlds the same.

    Chance would let a candidate of a search miss the member in which it falls.
    """
    return seed - seed % TURNS + turn % TURNS if isinstance(world, EnsembleWorld) else seed


@dataclass(frozen=True)
class EnsembleWorld:
    """Several simulators of one robot; it can be pickled.

    Attributes:
        world: What they are drawn around; it is measured where one simulator has to stand for all.
        members: The simulators.
    """

    world: BulletWorld
    members: tuple[BulletWorld, ...]

    @property
    def layout(self) -> Layout:
        """What an observation holds."""
        return self.world.layout

    def make(self) -> EnsembleEnv:
        """Build the environment."""
        return EnsembleEnv(self)


class EnsembleEnv(gymnasium.Env):
    """Every `reset` takes a member by its seed; members are built once and share one Bullet client, 28 MB each."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  gymnasium's own name and type

    def __init__(self, made: EnsembleWorld) -> None:
        self._members, self._built = made.members, dict[int, BulletEnv]()
        around = made.world.make()
        self.layout, self.action_space, self.observation_space = (
            around.layout, around.action_space, around.observation_space,
        )  # fmt: skip
        self._env: BulletEnv | None = None

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, bool]]:
        """Start anew in a member; arguments as those of `BulletEnv.reset`."""
        super().reset(seed=seed)
        turn = int(self.np_random.integers(TURNS)) if seed is None else seed % TURNS
        number = turn % len(self._members)
        if number not in self._built:
            host = next(iter(self._built.values()), None)
            self._built[number] = BulletEnv(self._members[number], host=host)
        env = self._built[number]
        if self._env is not None and self._env is not env:
            self._env.leave()
        self._env = env
        return env.reset(seed=seed, options=options)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, bool]]:
        """Act in this episode's member."""
        assert self._env is not None, "reset comes first"
        return self._env.step(action)

    def close(self) -> None:
        """Free Bullet's client."""
        for env in reversed(self._built.values()):
            env.close()
        self._built.clear()
        self._env = None
