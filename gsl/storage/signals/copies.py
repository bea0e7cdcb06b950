"""Copies: a command that is the position of this or of a near row, a position that is another joint's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gsl.core.trajectory import Trajectory
from gsl.storage.signals.finding import MOVES, Finding

ROWS = range(-2, 4)  # from a command's row to the position that it may be a copy of
SAME = 1e-5  # of a channel's range: what rounding in a file makes
MOSTLY = 0.98  # share of the moving rows that have to be alike: no servo follows so well
LEAST = 20  # moving rows that it takes to judge
UNLIKE = 0.1  # share of a command's range by which another has to differ


def find_copies(episodes: Sequence[Trajectory], joints: Sequence[str]) -> list[Finding]:
    """Return commands that are copies of positions, and positions and velocities that are copies of others."""
    findings = []
    for k, joint in enumerate(joints):
        rows = [row for row in ROWS if _same(_pairs(episodes, k, row))]
        if rows:
            row = min(rows, key=abs)
            of = {0: "this row", 1: "the next row", -1: "the row before"}.get(
                row, f"{abs(row)} rows {'on' if row > 0 else 'before'}"
            )
            problem = f"is a copy of the measured position of {of}: no servo follows so well, and nothing was commanded"
            remedy = "log what was sent to the servos"
            findings.append(Finding("copy", (f"action.{joint}",), (joint,), problem, remedy))
        if _same([(episode.velocity[:, k], episode.position[:, k]) for episode in episodes]):
            problem, remedy = f"is a copy of position.{joint}", "choose the column of the velocities, or leave it out"
            findings.append(Finding("copy", (f"velocity.{joint}",), (joint,), problem, remedy))
    return [*findings, *_of_positions(episodes, joints)]


def _of_positions(episodes: Sequence[Trajectory], joints: Sequence[str]) -> list[Finding]:
    findings = []
    for k, joint in enumerate(joints):
        for other in range(k):
            if not _differ_in_commands(episodes, k, other):
                continue
            if _same([(episode.position[:, k], episode.position[:, other]) for episode in episodes]):
                columns, both = (f"position.{joints[other]}", f"position.{joint}"), (joints[other], joint)
                problem = "are copies of each other though their commands differ"
                findings.append(Finding("copy", columns, both, problem, "look up which column is whose"))
    return findings


def _pairs(episodes: Sequence[Trajectory], k: int, row: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return commands, and the positions so many rows on."""
    pairs = []
    for episode in episodes:
        length = len(episode)
        first, last = max(0, -row), min(length, length + 1 - row)
        pairs.append((episode.action[first:last, k], episode.position[first + row : last + row, k]))
    return pairs


def _same(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> bool:
    """Whether two channels are alike wherever the second one moves."""
    a, b = (np.concatenate([pair[side] for pair in pairs]) for side in (0, 1))
    moving = np.concatenate([np.abs(np.diff(pair[1], prepend=np.nan)) > 0.0 for pair in pairs])
    if len(b) == 0 or np.ptp(b) < MOVES:
        return False
    moving &= np.abs(np.diff(b, prepend=b[0])) > SAME * np.ptp(b)
    return bool(moving.sum() >= LEAST and np.mean(np.abs(a - b)[moving] <= SAME * np.ptp(b)) > MOSTLY)


def _differ_in_commands(episodes: Sequence[Trajectory], k: int, other: int) -> bool:
    a, b = (np.concatenate([episode.action[:, joint] for episode in episodes]) for joint in (k, other))
    least = max(MOVES, UNLIKE * max(np.ptp(a), np.ptp(b)))
    return bool(np.ptp(a - b) > least)
