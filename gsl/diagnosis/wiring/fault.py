"""A wiring fault: what would have to be undone in a log, or in a simulator's settings, for the two to agree."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gsl.core.plant import Plant
from gsl.core.trajectory import Batch, Trajectory

ACTION, POSITION, BOTH = "action", "position", "both"
Change = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Fault:
    """A hypothesis that needs no physics.

    Attributes:
        kind: `permuted`, `sign`, `scale`, `offset`, `gains`, `rate`, `hold` or `shift`.
        joints: Indices of the joints that it is about.
        side: What of the log is wrong: `action`, `position`, `both`, or empty where it is neither.
        value: Its numbers, by name.
        mend: From the log as it is to the log without the fault.
        change: From the simulator as it is to the one that agrees.
        refloor: From the noise floor of the log's positions, shape (n_joints,), to that of the mended log's.
    """

    kind: str
    joints: tuple[int, ...]
    side: str
    value: Mapping[str, Any] = field(default_factory=dict)
    mend: Callable[[Batch], Batch] = lambda batch: batch
    change: Callable[[Plant], Plant] = lambda plant: plant
    refloor: Change = lambda floor: floor

    @property
    def key(self) -> tuple[str, ...]:
        """By which faults of one search are told apart: what mends them follows from it and the log."""
        return self.kind, self.side, repr(self.joints), repr(self.value)


def change_log(batch: Batch, *, action: Change | None = None, position: Change | None = None) -> Batch:
    """Return a log with other commands and positions, each a function of arrays of shape (T, n_joints)."""

    def alter(episode: Trajectory) -> Trajectory:
        commands = action(episode.action) if action else episode.action
        return replace(episode, action=commands, position=position(episode.position) if position else episode.position)

    return replace(batch, episodes=tuple(alter(episode) for episode in batch.episodes))


def rescale(
    kind: str, joints: Sequence[int], side: str, gain: np.ndarray, offset: np.ndarray, value: Mapping[str, Any]
) -> Fault:
    """Return the fault whose mending is gain · x + offset of some joints' commands, positions or both.

    Args:
        kind: `sign`, `scale` or `offset`.
        joints: Indices.
        side: What is changed.
        gain: Of all joints, those of others play no part, shape (n_joints,).
        offset: The same.
        value: What is said of it.
    """
    own = np.isin(np.arange(len(gain)), list(joints))
    gains, offsets = np.where(own, gain, 1.0), np.where(own, offset, 0.0)

    def change(x: np.ndarray) -> np.ndarray:
        return gains * x + offsets

    def refloor(floor: np.ndarray) -> np.ndarray:
        return floor if side == ACTION else np.abs(gains) * floor

    return Fault(kind, tuple(joints), side, value, _on(side, change), refloor=refloor)


def permute(order: Sequence[int], side: str) -> Fault:
    """Return the fault of joints that are exchanged: channel k of the mended log is channel order[k] of the log."""
    index = list(order)
    moved = tuple(k for k, other in enumerate(index) if k != other)

    def change(x: np.ndarray) -> np.ndarray:
        return x[:, index]

    def refloor(floor: np.ndarray) -> np.ndarray:
        return floor if side == ACTION else floor[index]

    return Fault("permuted", moved, side, {"order": index}, _on(side, change), refloor=refloor)


def _on(side: str, change: Change) -> Callable[[Batch], Batch]:
    """Return the mending of a log that changes one side of it, or both."""

    def mend(batch: Batch) -> Batch:
        action, position = side in (ACTION, BOTH), side in (POSITION, BOTH)
        return change_log(batch, action=change if action else None, position=change if position else None)

    return mend


def shift(rows: int, joints: Sequence[int]) -> Fault:
    """Return the fault of commands that act `rows` rows before the row that they are written in."""
    columns = list(joints)

    def change(x: np.ndarray) -> np.ndarray:
        result = x.copy()
        result[: len(x) - rows, columns] = x[rows:, columns]
        result[len(x) - rows :, columns] = x[-1, columns]
        return result

    return Fault("shift", tuple(joints), "", {"rows": -rows}, lambda batch: change_log(batch, action=change))


def hold(ticks: int, phase: int, joints: Sequence[int]) -> Fault:
    """Return the fault of a robot that takes every `ticks`-th command, the first one in row `phase` of an episode."""
    columns = list(joints)

    def change(x: np.ndarray) -> np.ndarray:
        rows = np.arange(len(x))
        taken = np.maximum(phase + (rows - phase) // ticks * ticks, 0)
        result = x.copy()
        result[:, columns] = x[taken][:, columns]
        return result

    return Fault(
        "hold", tuple(joints), "", {"ticks": ticks, "phase": phase}, lambda batch: change_log(batch, action=change)
    )


def rate(factor: float, joints: Sequence[int]) -> Fault:
    """Return the fault of rows that are `factor` times as far apart as the log says."""

    def mend(batch: Batch) -> Batch:
        episodes = tuple(replace(episode, time=factor * episode.time) for episode in batch.episodes)
        return replace(batch, episodes=episodes, control_period=factor * batch.control_period)

    return Fault("rate", tuple(joints), "", {"factor": factor}, mend)


def gains(kp: Sequence[float], kd: Sequence[float], joints: Sequence[int]) -> Fault:
    """Return the fault of gains that are other ones in the simulator, by factors of some joints."""

    def change(plant: Plant) -> Plant:
        factors = np.ones((2, len(plant.robot.controlled)))
        factors[0, list(joints)], factors[1, list(joints)] = kp, kd
        wide = factors[:, plant.robot.drive]
        return plant.with_servo(kp=wide[0] * plant.servo.kp, kd=wide[1] * plant.servo.kd)

    value = {"kp": list(kp), "kd": list(kd)}
    return Fault("gains", tuple(joints), "", value, change=change)
