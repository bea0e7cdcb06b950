"""How positions follow commands, without a simulator: which command, with which sign, by how much, about which zero."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from gsl.core.trajectory import Trajectory
from gsl.storage.signals.finding import MOVES

LATEST = 0.3  # lag at which a position may follow best [s]
LAGS = 16  # that are tried
FOLLOWS = 0.9  # correlation from which on a position follows a command
MARGIN = np.log(3.0)  # by which what is not explained has to fall before another joint's command is preferred
EVEN = 1e-4  # of variance: what is explained better than to that is explained as well


class Relation(NamedTuple):
    """How each joint's position follows commands, arrays of shape (n_joints,).

    Attributes:
        source: Index of the command that it follows, its own unless another is far better.
        likeness: Correlation with that command, with its sign, at the lag of the highest; 0 where it rests.
        factor: Spread of the position over that of the command, with the sign.
        offset: Mean of the position less that of the command [as logged].
        means: Of command and position, shape (2, n_joints).
    """

    source: np.ndarray
    likeness: np.ndarray
    factor: np.ndarray
    offset: np.ndarray
    means: np.ndarray


def relate(episodes: Sequence[Trajectory], period: float) -> Relation:
    """Return how the positions of a log follow its commands."""
    joints = episodes[0].action.shape[1]
    best, lags = np.zeros((joints, joints)), np.zeros((joints, joints), dtype=int)
    longest = max(1, round(LATEST / period))
    for lag in np.unique(np.linspace(0, longest, LAGS).round().astype(int)):
        alike = _correlations(*_stack(episodes, int(lag)))
        better = np.abs(alike) > np.abs(best)
        best, lags = np.where(better, alike, best), np.where(better, lag, lags)
    source = _assign(best)
    own = np.arange(joints)
    action, position = _stack(episodes, int(np.median(lags[own, source])))
    spreads = np.array([action[:, source].std(axis=0), position.std(axis=0)])
    means = np.array([action[:, source].mean(axis=0), position.mean(axis=0)])
    likeness = best[own, source]
    factor = np.sign(likeness) * spreads[1] / np.where(spreads[0] > 0.0, spreads[0], np.inf)
    return Relation(source, likeness, factor, means[1] - means[0], means)


def _stack(episodes: Sequence[Trajectory], lag: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the commands and the positions `lag` rows after those that they lead to, all episodes below another."""
    some = [episode for episode in episodes if len(episode) > lag + 2] or list(episodes)
    action = np.concatenate([episode.action[: max(1, len(episode) - lag)] for episode in some])
    position = np.concatenate([episode.position[min(1 + lag, len(episode)) :] for episode in some])
    return action, position


def _correlations(action: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return the correlation of each position with each command, 0 of one that rests, shape (n, n)."""
    a, q = action - action.mean(axis=0), position - position.mean(axis=0)
    sizes = np.outer(np.sqrt((q**2).sum(axis=0)), np.sqrt((a**2).sum(axis=0)))
    moving = np.ptp(action, axis=0) > MOVES
    result: np.ndarray = np.where(moving[None] & (sizes > 0.0), q.T @ a / np.where(sizes > 0.0, sizes, 1.0), 0.0)
    return result


def _assign(alike: np.ndarray) -> np.ndarray:
    """Return the command of each position such that each has one, its own unless another is far better."""
    cost = np.log(1.0 - np.minimum(alike**2, 1.0) + EVEN)
    own = np.diag(cost).copy()
    far = (np.abs(alike) < FOLLOWS) | (cost + MARGIN > own[:, None])
    np.fill_diagonal(far, False)
    bounded = np.where(far, 1e3, cost)
    np.fill_diagonal(bounded, own - MARGIN)
    _, source = linear_sum_assignment(bounded)
    return np.asarray(source)
