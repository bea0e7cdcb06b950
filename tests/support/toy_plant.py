"""Joints that go part of the way to their target in each tick, as a world and as recorded batches, for tests."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from gsl.core.layout import Layout
from gsl.core.trajectory import Batch, Trajectory

JOINTS = ("LHipPitch", "LKneePitch")
LAYOUT = Layout(JOINTS, {"position": 2, "velocity": 2, "gyro": 3}, 0.02)
QUICK, SLOW = 0.8, 0.3


class ToyEnv(gymnasium.Env):
    """x' = x + rate (a - x)."""

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, rate: float) -> None:
        self.layout, self.rate = LAYOUT, rate
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), dtype=np.float64)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (LAYOUT.size,), dtype=np.float64)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict]:
        super().reset(seed=seed)
        self.x, self.ticks = 0.1 * self.np_random.standard_normal(2), 0
        return self._observe(np.zeros(2)), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        change = self.rate * (action - self.x)
        self.x, self.ticks = self.x + change, self.ticks + 1
        return self._observe(change / 0.02), 0.0, False, False, {}

    def _observe(self, velocity: np.ndarray) -> np.ndarray:
        return np.r_[self.x, velocity, np.zeros(3)]


def an_episode(rate: float, seed: int, *, noise: float = 0.0, steps: int = 80) -> Trajectory:
    """Return an episode of a gait of two joints, with noise on what is carried out."""
    rng, env = np.random.default_rng(seed), ToyEnv(rate)
    seen, actions, sent = [env.reset(seed=seed)[0]], [], []
    phase, width = rng.uniform(0, 6), rng.uniform(0.2, 0.5, size=2)
    for tick in range(steps):
        actions.append(width * np.sin(0.3 * tick + phase + np.array([0.0, 1.0])))
        sent.append(actions[-1] + noise * rng.standard_normal(2))
        seen.append(env.step(sent[-1])[0])
    rows = np.array(seen)
    sensors = {f"gyro.{axis}": rows[:, 4 + index] for index, axis in enumerate("xyz")}
    time, grounded = 0.02 * np.arange(steps + 1), np.array(sent) if noise else None
    return Trajectory(time, np.array(actions), rows[:, :2], rows[:, 2:4], grounded_action=grounded, sensors=sensors)


def a_batch(rate: float, role: str, *, pi0: int = 3, others: int = 4, noise: float = 0.0) -> Batch:
    """Return episodes of pi0 and of neighbours."""
    names = ["pi0"] * pi0 + [f"neighbour_{index + 1:02d}" for index in range(others)]
    episodes = tuple(an_episode(rate, seed, noise=noise) for seed in range(len(names)))
    metadata = {"robot": "nao", "role": role, "episodes": [{"policy": name} for name in names]}
    return Batch(episodes, JOINTS, 0.02, metadata)
