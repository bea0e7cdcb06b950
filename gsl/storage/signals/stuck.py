"""Channels that are stuck: a position that is frozen, or that is read anew in some of the rows only."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gsl.core.trajectory import Trajectory
from gsl.storage.signals.finding import MOVES, Finding, Place, moves, per_joint

LONG, SECONDS = 15, 0.6  # rows and time [s] for which a moving joint's value may be exactly the same
LATE = 0.3  # lag [s] of a servo, play included: what is commanded so late in these rows moves the joint after them
ASKED = 0.35  # share of its command's range that has been commanded before, and
LEAST_ASKED = 0.15  # angle [rad]: play and stiction of a real arm swallow 0.08
END = 0.02  # share of its range from an end, within which a joint may be at a stop
REPEATED = 0.3  # share of the rows of quick motion that repeat the row before
QUICK = 3  # rows on either side over which motion is quick
STEPS = 4.0  # times the resolution that it goes on every row then
LEAST = 30  # rows of quick motion that it takes to judge


def find_stuck(episodes: Sequence[Trajectory], joints: Sequence[str]) -> list[Finding]:
    """Return positions and velocities that are frozen, and positions that are stale in most rows."""
    frozen = per_joint(
        "frozen", "position", _freezes(episodes), joints, "stays the same to the last digit while its command moves",
        "look at the cable or the reader of this joint, and cut the log there",
    )  # fmt: skip
    still = per_joint(
        "frozen", "velocity", _still(episodes), joints, "never changes while the position does",
        "leave the column out, and it is derived",
    )  # fmt: skip
    return [*frozen, *still, *_stale(episodes, joints)]


def _freezes(episodes: Sequence[Trajectory]) -> Iterator[Place]:
    for number, episode in enumerate(episodes):
        works = np.all([np.ones(len(episode)), *_list_flags(episode)], axis=0)
        for k in range(episode.action.shape[1]):
            row = _frozen_from(episode, k, works) if moves(episode, k) else None
            if row is not None:
                yield Place(k, number, row)


def _frozen_from(episode: Trajectory, k: int, works: np.ndarray) -> int | None:
    """Return the row from which a joint's position is the same while its command goes on, None if there is none."""
    position, command = episode.position[: len(episode), k], episode.action[:, k]
    late = int(np.ceil(LATE / np.median(np.diff(episode.time))))
    changes = np.flatnonzero(np.r_[True, np.diff(position) != 0.0, True])
    if np.ptp(position) > 0.0:
        low, high = position.min() + END * np.ptp(position), position.max() - END * np.ptp(position)
    else:
        low, high = -np.inf, np.inf
    for place in np.flatnonzero(np.diff(changes) >= LONG):
        first, last = changes[place], changes[place + 1]
        rows, lasts = slice(first, last), episode.time[last - 1] - episode.time[first]
        if lasts < SECONDS or not works[rows].all() or not low <= position[first] <= high:
            continue
        if np.ptp(command[first : max(first + 1, last - late)]) > max(LEAST_ASKED, ASKED * np.ptp(command)):
            return int(first)
    return None


def _list_flags(episode: Trajectory) -> list[np.ndarray]:
    return [values[: len(episode)] for key, values in episode.sensors.items() if key.partition(".")[0] == "enabled"]


def _still(episodes: Sequence[Trajectory]) -> Iterator[Place]:
    for k in range(episodes[0].action.shape[1]):
        speeds = np.concatenate([episode.velocity[:, k] for episode in episodes])
        if np.ptp(speeds) == 0.0 and any(np.ptp(episode.position[:, k]) > MOVES for episode in episodes):
            yield Place(k, 0, 0)


def _stale(episodes: Sequence[Trajectory], joints: Sequence[str]) -> list[Finding]:
    findings = []
    for k, joint in enumerate(joints):
        channels = [episode.position[:, k] for episode in episodes]
        if _share_repeated(channels) > REPEATED:
            runs = np.concatenate([np.diff(np.flatnonzero(np.diff(channel))) for channel in channels])
            rows = max(2.0, float(np.median(runs)) if len(runs) else 2.0)  # rests are few runs, however long
            problem = f"is read anew in every {_ordinal(rows)} row only and repeats itself between"
            remedy = "log at the rate of the sensors (mapping.period resamples), or read them in every row"
            findings.append(Finding("stale", (f"position.{joint}",), (joint,), problem, remedy))
    return findings


def _ordinal(rows: float) -> str:
    nearest = round(rows)
    return {2: "second", 3: "third", 4: "fourth", 5: "fifth"}.get(nearest, f"{nearest}th")


def _share_repeated(channels: Sequence[np.ndarray]) -> float:
    """Return the share of the rows of quick motion in which a channel repeats the row before; 0 if it has few."""
    steps = np.concatenate([np.abs(np.diff(channel)) for channel in channels])
    some = steps[steps > 0.0]
    if not len(some):
        return 0.0
    resolution = float(np.quantile(some, 0.05))
    repeats = []
    for channel in channels:
        if len(channel) <= 2 * QUICK + 1:
            continue
        far = np.abs(channel[2 * QUICK :] - channel[: -2 * QUICK]) > 2 * QUICK * STEPS * resolution
        far &= np.abs(channel[2 * QUICK :] - channel[: -2 * QUICK]) > MOVES
        repeats.append((np.diff(channel)[QUICK : QUICK + len(far)] == 0.0)[far])
    quick = np.concatenate(repeats) if repeats else np.zeros(0)
    return float(quick.mean()) if len(quick) >= LEAST else 0.0
