"""A world in which each policy's episodes are worth what a script says, one after the other; 0 is a fall."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np

from gsl.core.interfaces import Step
from gsl.core.layout import Layout
from gsl.core.setting import component
from gsl.tasks.excite import Excite

LAYOUT = Layout(("a",), {"position": 1, "velocity": 1}, 0.02)


@component
class ScriptedWorld:
    """An episode ends after one step; its value is the next one of the policy whose number is the action."""

    values: tuple[tuple[float, ...], ...] = ()
    layout = LAYOUT

    def make(self) -> gymnasium.Env:
        return ScriptedEnv(self.values)


class ScriptedEnv(gymnasium.Env):
    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, values: tuple[tuple[float, ...], ...]) -> None:
        self.layout, self.left = LAYOUT, [iter(some) for some in values]
        self.action_space = gymnasium.spaces.Box(0.0, len(values), (1,), dtype=np.float64)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (2,), dtype=np.float64)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict]:
        return np.zeros(2), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        value = next(self.left[round(float(action[0]))])
        return np.zeros(2), value, value == 0.0, True, {}


@component
class Numbered:
    """A policy is a number, and its action as well."""

    names = ("number",)
    initial, scale = np.zeros(1), np.ones(1)

    def posture(self, parameters: np.ndarray, layout: Layout) -> np.ndarray:
        return np.zeros(1)

    def start(self, parameters: np.ndarray, layout: Layout) -> Always:
        return Always(parameters)


class Always:
    def __init__(self, action: np.ndarray) -> None:
        self.action = action

    def act(self, observation: np.ndarray) -> np.ndarray:
        return self.action


@component
class AsScripted(Excite):
    """The world says what a step is worth."""

    def start(self, layout: Layout, observation: np.ndarray, role: str) -> AsScripted:
        return self

    def step(self, before: np.ndarray, after: np.ndarray, fell: bool) -> Step:
        return Step(None, ended=False)

    def outcome(self, layout: Layout, trajectory: Any) -> Mapping[str, float]:
        return {}
