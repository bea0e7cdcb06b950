"""Repeats: records of the same motion, whose difference is what a robot does not repeat.

A logger of a real robot has a clock of its own. It begins earlier or later, and a command reaches it up to a row late.
So two records repeat each other if their commands do as functions of time, and not only row by row. Under other
conditions the same commands are another motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy

from gsl.diagnosis.log.records import Record
from gsl.diagnosis.settings import RepeatSettings

DIGITS = 6  # of commands [rad] that are equal row by row
ROUNDING = 1e-9  # of a correlation: where several lags fit as well, the least counts
FEW = 10  # rows, below which two records are too short to be compared


class Repeat(NamedTuple):
    """Which motion a record is of, by number, and by how many rows it is later than the first record of that motion."""

    motion: int
    later: float = 0.0


def find_repeats(records: Sequence[Record], period: float, settings: RepeatSettings | None = None) -> list[Repeat]:
    """Return the motion of each record.

    Args:
        records: In an order of their own; of a motion's records, the first is what others are compared with.
        period: Control period [s].
        settings: What counts as the same.
    """
    how, repeats = settings or RepeatSettings(), list[Repeat]()
    firsts: list[_Motion] = []
    seen: dict[tuple[bytes, str], Repeat] = {}
    for record in records:
        exact = (np.round(record.commands, DIGITS).tobytes(), repr(record.conditions))
        if (repeat := seen.get(exact)) is None:
            motion = _Motion.of(record)
            repeat = _find(motion, firsts, period, how) or Repeat(len(firsts))
            if repeat.motion == len(firsts):
                firsts.append(motion)
            seen[exact] = repeat
        repeats.append(repeat)
    return repeats


class _Motion(NamedTuple):
    """What was commanded in a record, shape (T, width), under which conditions, its least and greatest, (width,)."""

    commands: np.ndarray
    conditions: Mapping[str, Any]
    low: np.ndarray
    high: np.ndarray
    comparable: bool

    @classmethod
    def of(cls, record: Record) -> _Motion:
        """Look at a record once; on the ground what a robot does depends on where it stands."""
        low, high = record.commands.min(axis=0, initial=np.inf), record.commands.max(axis=0, initial=-np.inf)
        comparable = record.base is None and bool(np.isfinite([low, high]).all())
        return cls(record.commands, record.conditions, low, high, comparable)


def _find(motion: _Motion, firsts: Sequence[_Motion], period: float, how: RepeatSettings) -> Repeat | None:
    """Return which of the motions so far another record repeats, if it does."""
    for number, first in enumerate(firsts):
        if _may_repeat(first, motion, how):
            later = _compare(first.commands, motion.commands, period, how)
            if later is not None:
                return Repeat(number, later)
    return None


def _may_repeat(first: _Motion, again: _Motion, how: RepeatSettings) -> bool:
    """Whether two motions are alike in conditions, length and range, without a look at when what comes."""
    lengths = len(first.commands), len(again.commands)
    if not (first.comparable and again.comparable) or first.conditions != again.conditions:
        return False
    if first.low.shape != again.low.shape or min(lengths) < max(FEW, how.share * max(lengths)):
        return False
    least = how.same + how.of_range * (first.high - first.low)
    return bool((np.maximum(np.abs(first.low - again.low), np.abs(first.high - again.high)) <= least).all())


def _compare(first: np.ndarray, again: np.ndarray, period: float, how: RepeatSettings) -> float | None:
    """Return by how many rows the same commands, shape (T, width), come later in another record; None for others."""
    moving = np.ptp(first, axis=0) > how.clear * how.same
    later = _align(first[:, moving], again[:, moving], round(how.apart / period)) if moving.any() else 0
    before, after = _overlap(first, again, later)
    if len(before) < how.share * max(len(first), len(again)):
        return None
    near = 2 * max(1, round(how.jitter / period)) + 1  # rows: so much late or early is the logger's
    low = scipy.ndimage.minimum_filter1d(before, near, axis=0, mode="nearest")
    high = scipy.ndimage.maximum_filter1d(before, near, axis=0, mode="nearest")
    outside = (after < low - how.same) | (after > high + how.same)
    if outside.mean(axis=0).max() > how.outside:
        return None
    return later + (_refine(before[:, moving], after[:, moving]) if moving.any() else 0.0)


def _align(first: np.ndarray, again: np.ndarray, most: int) -> int:
    """Return the whole rows, at most so many, by which commands are later where they are most alike."""
    a, b = (part - part.mean(axis=0) for part in (first, again))
    alike = sum(scipy.signal.correlate(b[:, k], a[:, k], method="fft") for k in range(a.shape[1]))
    lags = np.arange(1 - len(a), len(b))
    own = np.abs(lags) <= most
    best = alike[own] >= alike[own].max() - ROUNDING * np.abs(alike[own]).max()
    return int(min(lags[own][best], key=abs))


def _overlap(first: np.ndarray, again: np.ndarray, later: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows that two records share, one of which is so many rows later."""
    before, after = first[max(0, -later) :], again[max(0, later) :]
    shared = min(len(before), len(after))
    return before[:shared], after[:shared]


def _refine(before: np.ndarray, after: np.ndarray) -> float:
    """Return the part of a row by which commands are later beyond whole rows; 0 where they are equal."""
    slope = np.gradient(before, axis=0)
    return float(np.clip(-((after - before) * slope).sum() / max((slope**2).sum(), 1e-12), -0.5, 0.5))


def align_repeats(group: Sequence[tuple[Record, float]], period: float) -> np.ndarray:
    """Return what was measured in repeats of one motion at the same times of it, shape (repeats, rows, n_channels).

    Between rows it goes on at the record's velocity: a mean of two rows would have less noise than one.

    Args:
        group: Records, and by how many rows each is later than the motion's first one.
        period: Control period [s].
    """
    rows = [round(later) for _, later in group]
    start, stop = max(0, -min(rows)), min(len(record) - row for (record, _), row in zip(group, rows, strict=True))
    return np.array([
        _shift(record, later - row, period)[start + row : stop + row + 1]
        for (record, later), row in zip(group, rows, strict=True)
    ])  # fmt: skip


def _shift(record: Record, rows: float, period: float) -> np.ndarray:
    return record.measured if rows == 0.0 else record.position + rows * period * record.velocity
