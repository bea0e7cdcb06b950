"""Transitions: what a forward or an inverse model is fitted to, one row a control tick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gsl.core.history import History, windows, with_rest
from gsl.core.observation import read_sensors
from gsl.core.trajectory import Trajectory

FALLING = 25  # ticks before the end of a fall: balance is lost, the legs hit what they can


class Transitions(NamedTuple):
    """Inputs and outcomes.

    Attributes:
        windows: See `gsl.core.history`, shape (N, history.size(n_joints)).
        change: Of the joint positions over the horizon [rad], shape (N, n_joints).
    """

    windows: np.ndarray
    change: np.ndarray


def transitions(episodes: Sequence[Trajectory], history: History, horizon: int, *, carried_out: bool) -> Transitions:
    """Return the transitions of some episodes, the ends of falls left out.

    Args:
        episodes: Of one robot.
        history: What a window holds.
        horizon: Ticks ahead; the actions that follow the present one are as they come.
        carried_out: Whether `a` is what was sent, noise and grounding included, or what the agent issued.
    """
    parts = [_of_one(episode, history, horizon, carried_out=carried_out) for episode in episodes]
    return Transitions(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _of_one(episode: Trajectory, history: History, horizon: int, *, carried_out: bool) -> Transitions:
    x, action, body = (
        episode.position,
        actions(episode, carried_out=carried_out),
        read_sensors(episode, history.sensors),
    )
    last = usable(episode) - horizon + 1
    if history.rested:
        x, action, body = with_rest(history, x, action, body)
        last += history.span
    ticks = np.arange(history.span, last)
    return Transitions(windows(history, x, action, body, ticks), x[ticks + horizon] - x[ticks])


def actions(episode: Trajectory, *, carried_out: bool) -> np.ndarray:
    """Return the actions that were carried out, or those the agent issued [rad], shape (T, n_joints)."""
    if carried_out and episode.grounded_action is not None:
        return episode.grounded_action
    return episode.action


def usable(episode: Trajectory) -> int:
    """Return the number of ticks before balance is lost."""
    return max(len(episode) - FALLING * episode.ended_in_a_fall, 0)
