"""One-sample glitches: a row that is off both of its neighbours by far more than these differ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gsl.core.trajectory import Trajectory
from gsl.storage.signals.finding import Finding, Place, count, per_joint

FAR = 0.02  # least size [rad]: below, noise of coarse encoders comes to as much
BEYOND = 15.0  # times the usual distance from what the neighbours say, and
AROUND = 6.0  # times the largest one nearby
BESIDE = 2.0  # times the longest step of its neighbours
NEAR = 10  # rows on either side that are nearby
RARE = 0.02  # share of the rows above which it is how the channel is, and no glitch


def find_glitches(episodes: Sequence[Trajectory], joints: Sequence[str]) -> list[Finding]:
    """Return positions that have one-sample glitches; a command may jump as it likes."""
    places = [Place(k, n, row) for n, k, row in _glitches(episodes)]
    remedy = "mapping.glitches=mend interpolates such rows; look at the bus or the logger"
    findings = per_joint("glitch", "position", places, joints, "", remedy)
    return [
        finding._replace(problem=f"jumps for one sample and is back in the next, {count(finding.times)}")
        for finding in findings
    ]


def mend(values: np.ndarray) -> np.ndarray:
    """Return channels whose one-sample glitches are interpolated, shape (T, n)."""
    result = values.copy()
    for k in range(values.shape[1]):
        rows = find_rows(values[:, k])
        keep = np.setdiff1d(np.arange(len(values)), rows)
        result[rows, k] = np.interp(rows, keep, values[keep, k])
    return result


def find_rows(values: np.ndarray) -> list[int]:
    """Return the rows of a channel that are glitches."""
    if len(values) < 2 * NEAR:
        return []
    a, b, c, d, e = (values[k : len(values) - 4 + k] for k in range(5))
    off = np.abs(c - (-a + 4.0 * b + 4.0 * d - e) / 6.0)  # a cubic through two neighbours on either side
    beside = np.maximum(np.abs(d - b), np.maximum(np.abs(b - a), np.abs(e - d)))
    off = np.minimum(off, np.minimum(np.abs(c - b), np.abs(c - d)))  # a top that is reached and left in steps is none
    usual = 1.5 * float(np.median(off))
    rows = np.flatnonzero((off > np.maximum(FAR, BEYOND * usual)) & (off > BESIDE * beside))
    chosen = [int(row) for row in rows if _stands_out(off, int(row))]
    return [row + 2 for row in chosen] if len(chosen) <= max(1.0, RARE * len(values)) else []


def _stands_out(off: np.ndarray, row: int) -> bool:
    """Whether a row is far more off than all around it; two rows on either side are off because of it."""
    around = np.r_[off[max(0, row - NEAR) : max(0, row - 2)], off[row + 3 : row + 1 + NEAR]]
    return bool(off[row] > AROUND * around.max(initial=0.0))


def _glitches(episodes: Sequence[Trajectory]) -> Iterator[tuple[int, int, int]]:
    for number, episode in enumerate(episodes):
        for k in range(episode.position.shape[1]):
            for row in find_rows(episode.position[:, k]):
                yield number, k, row
