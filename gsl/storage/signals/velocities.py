"""Logged velocities against the slope of the positions: another sign, or another joint's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gsl.core.trajectory import Trajectory
from gsl.storage.signals.finding import Finding

FOLLOWS, UNLIKE = 0.85, 0.4  # correlations above and below which a velocity is that of a position, or is not
SLOW = 0.05  # slopes below are noise [rad/s]


def find_velocities(episodes: Sequence[Trajectory], joints: Sequence[str]) -> list[Finding]:
    """Return velocities that have the other sign, or that are another joint's."""
    slopes = np.concatenate([np.gradient(episode.position, episode.time, axis=0) for episode in episodes])
    logged = np.concatenate([episode.velocity for episode in episodes])
    alike = _correlations(logged, slopes)
    findings = []
    for k, joint in enumerate(joints):
        if alike[k, k] < -FOLLOWS:
            problem, remedy = f"has the other sign than the slope of position.{joint}", "say sign: -1 in its signal"
            findings.append(Finding("velocity", (f"velocity.{joint}",), (joint,), problem, remedy))
        elif abs(alike[k, k]) < UNLIKE and (other := int(np.argmax(alike[k]))) != k and alike[k, other] > FOLLOWS:
            if abs(alike[other, other]) > FOLLOWS:  # both move alike: nothing is exchanged
                continue
            problem = f"is the slope of position.{joints[other]} and not of position.{joint}"
            findings.append(Finding("velocity", (f"velocity.{joint}",), (joint,), problem, "swap the columns"))
    return findings


def _correlations(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the correlation of each column of `a` with each of `b`, 0 of one that hardly moves, shape (n, n)."""
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    sizes = np.sqrt(np.mean(a**2, axis=0)), np.sqrt(np.mean(b**2, axis=0))
    outer = np.outer(*sizes)
    moving = np.outer(sizes[0] > 0.0, sizes[1] > SLOW)
    result: np.ndarray = np.where(moving, a.T @ b / len(a) / np.where(outer > 0.0, outer, 1.0), 0.0)
    return result
