"""A trajectory is one episode as arrays; a batch is several of one robot at one control rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Trajectory:
    """One episode of T control steps, hence T + 1 measured states.

    Attributes:
        time: From the start of the episode [s], shape (T + 1,).
        action: Desired joint positions the agent issued [rad], shape (T, n_actions).
        position: Joint positions measured before the action [rad], shape (T + 1, n_joints).
        velocity: Joint velocities measured before the action [rad/s], shape (T + 1, n_joints).
        grounded_action: What the grounding sent instead [rad], shape (T, n_actions), if there was one.
        reward: Reward of each action, shape (T,), if a task gave one.
        fell: Whether the robot lies on the ground, shape (T + 1,), if it can fall.
        sensors: Further columns of the contract by name, such as `gyro.x`, each of shape (T + 1,).
        state: Of a world whose state is not joints, shape (T + 1, n_states); position and velocity are empty then.
    """

    time: np.ndarray
    action: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    grounded_action: np.ndarray | None = None
    reward: np.ndarray | None = None
    fell: np.ndarray | None = None
    sensors: Mapping[str, np.ndarray] = field(default_factory=dict)
    state: np.ndarray | None = None

    def __len__(self) -> int:
        """Number of control steps T."""
        return len(self.action)

    def only(self, columns: Sequence[int]) -> Trajectory:
        """Return the same of some joints alone, by number."""
        sent = self.grounded_action
        return replace(
            self,
            action=self.action[:, columns],
            position=self.position[:, columns],
            velocity=self.velocity[:, columns],
            grounded_action=None if sent is None else sent[:, columns],
        )

    @property
    def ended_in_a_fall(self) -> bool:
        """Whether the robot fell in this episode."""
        return self.fell is not None and bool(self.fell[-1])

    @property
    def value(self) -> float:
        """The return: sum of the rewards."""
        return float(np.sum(self.reward)) if self.reward is not None else float("nan")


@dataclass(frozen=True)
class Batch:
    """Trajectories of one robot: what one parquet file holds.

    Attributes:
        episodes: The trajectories.
        joints: Names of the action, position and velocity columns, in order; by number where the state is not joints.
        control_period: Nominal time between two actions [s].
        metadata: Where the data come from: role, source, seed, world, policy and whatever else is known.
    """

    episodes: tuple[Trajectory, ...]
    joints: tuple[str, ...]
    control_period: float
    metadata: Mapping[str, Any] = field(default_factory=dict)

    @property
    def states(self) -> int:
        """Number of entries of a state that is not joints; 0 for a robot."""
        first = self.episodes[0].state
        return 0 if first is None else int(first.shape[1])

    def only(self, joints: Sequence[str]) -> Batch:
        """Return the same of some joints alone."""
        if tuple(joints) == self.joints:
            return self
        columns = [self.joints.index(joint) for joint in joints]
        return replace(self, episodes=tuple(episode.only(columns) for episode in self.episodes), joints=tuple(joints))

    def __len__(self) -> int:
        """Number of episodes."""
        return len(self.episodes)

    def __repr__(self) -> str:
        seconds = sum(len(episode) for episode in self.episodes) * self.control_period
        return f"Batch({len(self)} episodes, {seconds:.1f} s, {len(self.joints)} joints)"
