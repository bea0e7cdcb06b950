"""A model that is fed with its own answers, as it will be in the grounded simulator: errors of one tick add up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gsl.core.history import History, windows
from gsl.core.observation import read_sensors
from gsl.core.trajectory import Trajectory
from gsl.core.transitions import actions, usable
from gsl.models.ensemble import Forward
from gsl.models.inverse import InverseModel

TICKS = 10  # of a free run, and of a replay in the simulator: 0.2 s at 50 Hz


def shortest(history: History, horizon: int) -> int:
    """Return how many ticks an episode must have for a free run."""
    return history.span + TICKS + horizon


class Segments(NamedTuple):
    """Pieces of trajectories laid end to end, each of `history.span + ticks + 1` ticks.

    Attributes:
        history: For whose windows they were cut.
        ticks: That can be predicted.
        position: Joint positions [rad], shape (N * length, n_joints).
        action: [rad], shape (N * length, n_joints).
        sensed: Body sensors, shape (N * length, n_sensed).
        starts: Tick from which each piece is predicted, shape (N,).
    """

    history: History
    ticks: int
    position: np.ndarray
    action: np.ndarray
    sensed: np.ndarray
    starts: np.ndarray


def segments(
    episodes: Sequence[Trajectory], history: History, *, carried_out: bool, ticks: int = TICKS, every: int = TICKS
) -> Segments:
    """Cut trajectories into pieces of some ticks to be predicted and their past, a piece `every` so many ticks."""
    length, parts = history.span + ticks + 1, []
    for episode in episodes:
        columns = episode.position, actions(episode, carried_out=carried_out), read_sensors(episode, history.sensors)
        cuts = range(0, usable(episode) - length + 1, every)
        parts += [tuple(column[cut : cut + length] for column in columns) for cut in cuts]
    position, action, body = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Segments(history, ticks, position, action, body, history.span + length * np.arange(len(parts)))


def predict_error(model: Forward, pieces: Segments) -> np.ndarray:
    """Return the error of the joint positions at the end of the pieces [rad], shape (N, n_joints)."""
    x, last = pieces.position.copy(), pieces.starts + pieces.ticks
    for tick in range(pieces.ticks):
        now = pieces.starts + tick
        x[now + 1] = x[now] + model.effects(windows(model.history, x, pieces.action, pieces.sensed, now))
    error: np.ndarray = x[last] - pieces.position[last]
    return error


def standstill_error(pieces: Segments) -> np.ndarray:
    """Return the same error of a robot that does not move [rad], shape (N, n_joints)."""
    error: np.ndarray = pieces.position[pieces.starts] - pieces.position[pieces.starts + pieces.ticks]
    return error


def recover_error(model: InverseModel, pieces: Segments) -> np.ndarray:
    """Return how far off the actions are that an inverse model recovers from the motion [rad], shape (.., n_joints).

    The past actions it sees are its own answers; the first tick of a piece, where they are not yet, does not count.
    """
    a, errors = pieces.action.copy(), []
    for tick in range(pieces.ticks + 1 - model.horizon):
        now = pieces.starts + tick
        wanted = pieces.position[now + model.horizon] - pieces.position[now]
        a[now] = model.actions(windows(model.history, pieces.position, a, pieces.sensed, now), a[now], wanted)
        errors.append(a[now] - pieces.action[now])
    return np.concatenate(errors[1:] or errors)
