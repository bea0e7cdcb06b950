"""Commands beside the positions of a trajectory: a desired speed and a feed-forward torque for each joint."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gsl.core.body import Robot
from gsl.core.trajectory import Batch, Trajectory

OTHER_COMMANDS = ("velocity_command", "torque_command")  # groups of columns, in the order of `read_other_commands`


def find_other_commands(batch: Batch) -> Iterator[str]:
    """Yield the columns of such commands that are not 0 everywhere, episode by episode."""
    for episode in batch.episodes:
        for group in OTHER_COMMANDS:
            for joint in batch.joints:
                if np.any(episode.sensors.get(f"{group}.{joint}", np.zeros(1))[: len(episode)]):
                    yield f"{group}.{joint}"


def has_other_commands(batch: Batch) -> bool:
    """Whether there is such a command that is not 0."""
    return next(find_other_commands(batch), None) is not None


def read_other_commands(episode: Trajectory, robot: Robot) -> np.ndarray:
    """Return desired speeds [rad/s], then feed-forward torques [N·m], shape (T, 2 n_motors); 0 if not logged."""
    none, parts = np.zeros(len(episode)), []
    for group in OTHER_COMMANDS:
        columns = [episode.sensors.get(f"{group}.{joint}", none)[: len(none)] for joint in robot.controlled]
        parts.append(np.stack(columns, axis=1)[:, robot.drive])
    return np.hstack(parts)
