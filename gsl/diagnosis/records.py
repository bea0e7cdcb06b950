"""A record is a logged trajectory as a replay wants it: motor targets in, measured joints out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from gsl.core.body import Robot
from gsl.core.trajectory import Batch
from gsl.worlds.held import Windows
from gsl.worlds.servo import COMMANDS

SMOOTHER = 7  # ticks of the cubic that tells a window's first velocity


@dataclass(frozen=True)
class Record:
    """One trajectory of T control periods.

    Attributes:
        name: Which motion it is, the same for repeats.
        targets: Of the motors [rad], shape (T, n_motors).
        position: Measured before each command and after the last one [rad], shape (T + 1, n_joints).
        velocity: Slope of a smoother through the positions [rad/s], shape (T + 1, n_joints).
    """

    name: str
    targets: np.ndarray
    position: np.ndarray
    velocity: np.ndarray

    def __len__(self) -> int:
        """Control periods T."""
        return len(self.targets)


def records(batch: Batch, robot: Robot) -> tuple[Record, ...]:
    """Return a batch's trajectories as records, in order.

    Args:
        batch: Its joints are the robot's controlled ones.
        robot: Whose motors follow.
    """
    labels = batch.metadata.get("episodes") or []
    names = [str(label.get("policy", "")) for label in labels] if len(labels) == len(batch) else [""] * len(batch)
    drive = robot.drive
    return tuple(
        Record(name, episode.action[:, drive], episode.position, slope(episode.position, batch.control_period))
        for name, episode in zip(names, batch.episodes, strict=True)
    )


def slope(position: np.ndarray, period: float) -> np.ndarray:
    """Return the velocities of a smoother through positions [rad], both of shape (T + 1, n_joints) [rad/s]."""
    length = min(SMOOTHER, len(position) - (len(position) + 1) % 2)
    return savgol_filter(position, length, min(3, length - 1), deriv=1, delta=period, axis=0, mode="interp")


@dataclass(frozen=True)
class Pieces:
    """Windows of records and what was measured in them.

    Attributes:
        windows: To replay.
        real: Positions after each control period [rad], shape (W, T, n_joints).
        record: Index of each window's record, shape (W,).
        tick: Control period at which each begins, shape (W,).
        warm_up: Control periods at the beginning that are not scored.
    """

    windows: Windows
    real: np.ndarray
    record: np.ndarray
    tick: np.ndarray
    warm_up: int

    def __len__(self) -> int:
        """Number of windows."""
        return len(self.tick)

    def chosen(self, index: np.ndarray) -> Pieces:
        """Return some of the windows."""
        windows = Windows(*(part[index] for part in self.windows))
        return Pieces(windows, self.real[index], self.record[index], self.tick[index], self.warm_up)


def pieces(found: Sequence[Record], robot: Robot, period: float, *, warm_up: int, scored: int) -> Pieces:
    """Cut records into windows, one after the other with the scored parts side by side.

    Args:
        found: The records.
        robot: Theirs.
        period: Control period [s].
        warm_up: Control periods at the beginning of a window that are not scored.
        scored: Control periods that are.
    """
    drive, length = robot.drive, warm_up + scored
    commands, motion, real, record, tick = [], [], [], [], []
    for index, one in enumerate(found):
        padded = np.vstack([np.repeat(one.targets[:1], COMMANDS, axis=0), one.targets])
        for start in range(0, len(one) - length + 1, scored):
            commands.append(padded[start + 1 : start + COMMANDS + length][::-1])
            motion.append([one.position[start, drive], one.velocity[start, drive]])
            real.append(one.position[start + 1 : start + 1 + length])
            record.append(index)
            tick.append(start)
    windows = Windows(np.array(commands), np.array(motion), period * np.array(tick, dtype=float))
    return Pieces(windows, np.array(real), np.array(record), np.array(tick), warm_up)
