"""A network and its wiring in one episode: from an observation of gsl to what the network sees, and to an action."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium
import numpy as np

from gsl.core.layout import Layout
from gsl.core.words import several
from gsl.errors import GslError
from gsl.policies.signals import Episode
from gsl.policies.wiring import Wiring, factors

Answer = Callable[[np.ndarray], np.ndarray]
"""A network in one episode: from what it sees, shape (n_inputs,), to its outputs, shape (n_outputs,)."""
Spaces = tuple[gymnasium.Space[Any], gymnasium.Space[Any]]


class Eyes:
    """What a network sees, in one episode; it remembers the history.

    Args:
        wiring: Of the network.
        layout: Of the world.
    """

    def __init__(self, wiring: Wiring, layout: Layout) -> None:
        self._parts, self._wiring, self._period = wiring.parts(layout), wiring, layout.control_period
        self.episode = Episode(0.0, np.zeros(len(wiring.moves(layout))))
        self._seen: list[list[np.ndarray]] = []

    @property
    def size(self) -> int:
        """How many numbers a network sees."""
        return self._wiring.history * sum(len(part.names) for part in self._parts)

    def look(self, observation: np.ndarray) -> np.ndarray:
        """Return what the network sees, shape (size,); the first observation of an episode fills the history."""
        frame = [part.read(observation, self.episode) for part in self._parts]
        self._seen = [*(self._seen or (self._wiring.history - 1) * [frame]), frame][-self._wiring.history :]
        self.episode.time += self._period
        frames = self._seen if self._wiring.newest == "last" else self._seen[::-1]
        if self._wiring.stacked == "term":
            frames = [[frame[term] for frame in frames] for term in range(len(self._parts))]
        values = np.concatenate([numbers for frame in frames for numbers in frame])
        return values if self._wiring.limit is None else np.clip(values, -self._wiring.limit, self._wiring.limit)


class Hands:
    """What the outputs of a network do in a world.

    Args:
        wiring: Of the network.
        layout: Of the world.
    """

    def __init__(self, wiring: Wiring, layout: Layout) -> None:
        self._moved = np.array(layout.numbers(wiring.moves(layout)))
        self._rest, self._limit, self._choices = wiring.stance(layout), wiring.action_limit, layout.choices
        self._scale = factors(wiring.scale, wiring.outputs(layout), "policy.wiring.scale")
        ends = np.array(layout.ranges) if layout.ranges else None
        self._middle = None if ends is None else ends.mean(axis=1)
        self._half = None if ends is None else (ends[:, 1] - ends[:, 0]) / 2.0

    def act(self, outputs: np.ndarray) -> np.ndarray:
        """Return the action of gsl's world, shape (n_joints,)."""
        if self._choices:
            return np.array([float(outputs[0]) if len(outputs) == 1 else float(np.argmax(outputs))])
        if self._limit is not None:
            outputs = np.clip(outputs, -self._limit, self._limit)
        action = self._rest.copy()
        action[self._moved] += self._scale * outputs
        if self._middle is None or self._half is None:
            return action
        return np.clip((action - self._middle) / self._half, -1.0, 1.0)


class WiredRun:
    """A network in one episode.

    Args:
        wiring: Of the network.
        layout: Of the world.
        answer: The network.
        offset: What is added to its actions, shape (n_joints,).
        where: What an error calls the network.
    """

    def __init__(self, wiring: Wiring, layout: Layout, answer: Answer, offset: np.ndarray | None, where: str) -> None:
        self._eyes, self._hands, self._answer = Eyes(wiring, layout), Hands(wiring, layout), answer
        self._offset, self._check = offset, partial(check_outputs, wiring=wiring, layout=layout, where=where)

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Return the action, shape (n_joints,).

        Raises:
            GslError: The network returns another number of outputs, or one that is not finite.
        """
        outputs = self._check(self._answer(self._eyes.look(observation)))
        self._eyes.episode.last_action = outputs
        action = self._hands.act(outputs)
        return action if self._offset is None else action + self._offset


def check_outputs(answer: np.ndarray, wiring: Wiring, layout: Layout, where: str) -> np.ndarray:
    """Return what a network has answered as its outputs, shape (n_outputs,).

    Args:
        answer: Of any shape.
        wiring: Of the network.
        layout: Of the world.
        where: What an error calls the network.

    Raises:
        GslError: It is another number of outputs, or one is not finite.
    """
    outputs, count = np.asarray(answer, dtype=float).ravel(), wiring.outputs(layout)
    if len(outputs) != count and not (layout.choices and len(outputs) == 1):  # a choice may be one number
        raise GslError(f"{where}: returns {several(len(outputs), 'number')}; the wiring has {several(count, 'output')}")
    if not np.isfinite(outputs).all():
        raise GslError(f"{where}: output {int(np.argmin(np.isfinite(outputs)))} is not finite")
    return outputs


class WiredEnv(gymnasium.Wrapper):
    """An environment of gsl as a network of some wiring sees it: its observation, and actions in its unit.

    Args:
        env: An environment whose observations and actions are those of the layout.
        wiring: Of the network.
        layout: Of the world.
        spaces: Of observations and actions, as the network was trained with them; by default those of the wiring.
    """

    def __init__(self, env: gymnasium.Env, wiring: Wiring, layout: Layout, spaces: Spaces | None = None) -> None:
        super().__init__(env)
        self._wiring, self._layout, self._hands = wiring, layout, Hands(wiring, layout)
        self._eyes = Eyes(wiring, layout)
        self.observation_space, self.action_space = spaces or self._spaces()
        self._first = int(getattr(self.action_space, "start", 0))  # of choices

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._eyes = Eyes(self._wiring, self._layout)
        return self._look(observation), info

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Act."""
        outputs = np.atleast_1d(np.asarray(action, dtype=float)) - self._first
        self._eyes.episode.last_action = outputs
        observation, reward, ended, cut, info = self.env.step(self._hands.act(outputs))
        return self._look(observation), float(reward), ended, cut, info

    def _spaces(self) -> Spaces:
        seen = gymnasium.spaces.Box(-np.inf, np.inf, (self._eyes.size,), dtype=np.float32)
        if self._layout.choices:
            return seen, self.env.action_space
        low, high = output_ends(self._wiring, self._layout)
        return seen, gymnasium.spaces.Box(low, high, dtype=np.float32)

    def _look(self, observation: np.ndarray) -> np.ndarray:
        return self._eyes.look(observation).astype(self.observation_space.dtype)


def output_ends(wiring: Wiring, layout: Layout) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the greatest output that a trainer should try, single precision, shape (n_outputs,) each.

    Those of an environment's own range; of a robot the limit of the outputs, 1 if there is none.
    """
    if layout.ranges:
        ends = np.array(layout.ranges)[layout.numbers(wiring.moves(layout))]
        scale = factors(wiring.scale, len(ends), "policy.wiring.scale")
        both = np.sort(ends / scale[:, None], axis=1).astype(np.float32)
        return both[:, 0], both[:, 1]
    most = np.full(wiring.outputs(layout), wiring.action_limit or 1.0, dtype=np.float32)
    return -most, most
