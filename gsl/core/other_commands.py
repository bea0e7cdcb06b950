"""Commands beside the positions of a trajectory: a desired speed, a feed-forward torque and gains for each joint."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gsl.core.body import Robot
from gsl.core.plant import nominal
from gsl.core.trajectory import Batch, Trajectory

OTHER_COMMANDS = ("velocity_command", "torque_command")  # groups of columns, in the order of `read_other_commands`
GAINS = {"kp_command": "kp", "kd_command": "kd"}  # group of columns -> gain of the servo
GAIN_EFFECT = "servo_gain"  # by which a simulator gets a log's gains
LOGGED_GAINS = "logged_gains"  # what metrics call the entries of that effect
SAME = 1e-6  # relative: a gain that differs less is the same, as files round


def find_other_commands(batch: Batch) -> Iterator[str]:
    """Yield the columns of such commands that are not 0 everywhere, then of gains that vary, episode by episode."""
    for episode in batch.episodes:
        for group in OTHER_COMMANDS:
            for joint in batch.joints:
                if np.any(episode.sensors.get(f"{group}.{joint}", np.zeros(1))[: len(episode)]):
                    yield f"{group}.{joint}"
    yield from find_varying_gains([episode.sensors for episode in batch.episodes], batch.joints)


def has_other_commands(batch: Batch) -> bool:
    """Whether there is such a command that is not 0, or a gain that varies."""
    return next(find_other_commands(batch), None) is not None


def find_varying_gains(sensors: Sequence[Mapping[str, np.ndarray]], joints: Sequence[str]) -> Iterator[str]:
    """Yield the columns of gains that are not the same in all rows of all trajectories."""
    for group in GAINS:
        for joint in joints:
            values = read_gains(sensors, f"{group}.{joint}")
            if len(values) and np.ptp(values) > SAME * np.abs(values).max():
                yield f"{group}.{joint}"


def read_gains(sensors: Sequence[Mapping[str, np.ndarray]], column: str) -> np.ndarray:
    """Return all values of a column of gains; the last row of a trajectory has no command."""
    return np.concatenate([np.zeros(0), *(columns[column][:-1] for columns in sensors if column in columns)])


def gains_of(metrics: Mapping[str, Any]) -> dict[str, Any]:
    """Return the effects by which a log's gains came to the simulator of an artifact, from its metrics."""
    return {GAIN_EFFECT: metrics[LOGGED_GAINS]} if LOGGED_GAINS in metrics else {}


def read_other_commands(episode: Trajectory, robot: Robot, *, gains: bool = False) -> np.ndarray:
    """Return desired speeds [rad/s], then feed-forward torques [N·m], shape (T, 2 n_motors); 0 if not logged.

    Args:
        episode: Of the log.
        robot: Whose motors follow.
        gains: Whether the shares of the robot's kp and kd that the log's gains are follow, shape (T, 4 n_motors); 1 if
            not logged.
    """
    rows = len(episode)
    values = [_columns(episode, group, robot, np.zeros(rows)) for group in OTHER_COMMANDS]
    if gains:
        servo = nominal(robot).servo
        for group, gain in GAINS.items():
            own = getattr(servo, gain)
            logged = _columns(episode, group, robot, np.full(rows, np.nan))
            share = np.divide(logged, own, out=np.ones_like(logged), where=own > 0.0)
            values.append(np.where(np.isnan(share), 1.0, share))
    return np.hstack(values)


def split_other_commands(commands: np.ndarray, motors: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return desired speeds, feed-forward torques and shares of kp and kd of commands, shapes (..., n_motors).

    Args:
        commands: As servos are sent them, shape (..., n_motors), (..., 3 n_motors) or (..., 5 n_motors).
        motors: n_motors.
    """
    zero = np.zeros((*commands.shape[:-1], motors))
    parts = list(np.split(commands, commands.shape[-1] // motors, axis=-1))[1:]
    parts += [zero, zero, zero + 1.0, zero + 1.0][len(parts) :]
    return parts[0], parts[1], parts[2], parts[3]


def _columns(episode: Trajectory, group: str, robot: Robot, none: np.ndarray) -> np.ndarray:
    columns = [episode.sensors.get(f"{group}.{joint}", none)[: len(none)] for joint in robot.controlled]
    return np.stack(columns, axis=1)[:, robot.drive]
