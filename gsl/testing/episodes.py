"""Short episodes to check components in: a robot that holds its posture, or swings about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsl.core.interfaces import SIM, Task, World
from gsl.core.layout import Layout
from gsl.core.trajectory import Batch, Trajectory
from gsl.grounding.none import NoGrounding
from gsl.rollout.rollout import Scenario, rollout
from gsl.tasks.excite import Excite
from gsl.worlds.bullet import BulletWorld

WORLD = BulletWorld(robot="nao", effects={}, settle=0.1)
SWING = 0.1  # [rad]
EPISODES, SECONDS = 5, 0.5


@dataclass(frozen=True)
class Swing:
    """Moves every joint about its posture.

    Attributes:
        world: Whose joints.
        size: Of the swing [rad], 0 to hold.
    """

    world: World
    size: float = 0.0
    names: tuple[str, ...] = ()

    @property
    def initial(self) -> np.ndarray:
        """It has no parameters."""
        return np.zeros(0)

    @property
    def scale(self) -> np.ndarray:
        """It has no parameters."""
        return np.zeros(0)

    def posture(self, parameters: np.ndarray, layout: Layout) -> np.ndarray:
        """Return zero angles, or the nearest that the joints reach [rad], shape (n_joints,)."""
        space = self.world.make().action_space
        return np.clip(np.zeros(len(layout.joints)), space.low, space.high)  # type: ignore[attr-defined]

    def start(self, parameters: np.ndarray, layout: Layout) -> Swinging:
        """Begin an episode."""
        return Swinging(self.posture(parameters, layout), self.size)


class Swinging:
    """A swing in one episode."""

    def __init__(self, posture: np.ndarray, size: float) -> None:
        self._posture, self._size, self._tick = posture, size, 0

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Return where the joints should be [rad], shape (n_joints,)."""
        self._tick += 1
        phase = np.arange(len(self._posture))
        return self._posture + self._size * (np.sin(0.3 * self._tick + phase) - np.sin(phase))


def observe(world: World, ticks: int, posture: np.ndarray | None = None) -> np.ndarray:
    """Return what a robot senses that holds a posture, shape (at most ticks + 1, layout.size)."""
    env = world.make()
    held = Swing(world).posture(np.zeros(0), world.layout) if posture is None else posture
    rows = [env.reset(seed=1, options={"posture": held})[0]]
    for _ in range(ticks):
        observation, _, ended, cut, _ = env.step(held)
        rows.append(observation)
        if ended or cut:
            break
    env.close()
    return np.array(rows)


def record(world: World, task: Task, *, size: float = 0.0, seed: int = 1) -> Trajectory:
    """Return an episode at a task."""
    scenario = Scenario(world, task, Swing(world, size), SIM, NoGrounding())
    env = scenario.make()
    trajectory = rollout(scenario, env, np.zeros(0), seed)
    env.close()
    return trajectory


def collect(world: World) -> Batch:
    """Return some short episodes of swings."""
    episodes = tuple(record(world, Excite(duration=SECONDS), size=SWING * k, seed=k) for k in range(EPISODES))
    names = [{"policy": "pi0" if k < 2 else f"neighbour_{k:02d}"} for k in range(EPISODES)]
    return Batch(episodes, world.layout.joints, world.layout.control_period, {"episodes": names})
