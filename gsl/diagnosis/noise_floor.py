"""The noise floor: how far two logs of the same commands differ, or what the log's own roughness tells of that."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.records import Record

MEAN = 5  # ticks of the low pass that joints that shake are seen through
SETTLED = 15  # ticks after which the start of an episode is forgotten
ESTIMATE = 200  # samples that an estimate from roughness is worth: other motion than noise is in it
UNSTEADY = 4.0  # times the median of the joints
QUIET = 0.3  # share of the ticks, those of the slowest commands, on which roughness is measured


@dataclass(frozen=True)
class NoiseFloor:
    """What noise alone explains.

    Attributes:
        sd: Standard deviation of a measured position [rad], shape (n_joints,).
        slow: Of its means over MEAN ticks, by repeats; 0 without [rad], shape (n_joints,).
        unsteady: Joints whose repeats differ by much more than those of the others, whose floor they get, (n_joints,).
        source: `repeats` or `estimated`.
        pairs: Repeats that were compared.
        resolution: Of the encoders [rad].
        samples: Independent numbers that it comes from, over all joints.
    """

    sd: np.ndarray
    slow: np.ndarray
    unsteady: np.ndarray
    source: str
    pairs: int
    resolution: float
    samples: int

    @property
    def slack(self) -> float:
        """How much more than expected a residual may cost because the floor is itself measured, relative."""
        return float(2.0 * np.sqrt(2.0 / max(self.samples, 1)))


def noise_floor(
    found: Sequence[Record], resolution: float, least: np.ndarray | None = None, held: Sequence[int] = ()
) -> NoiseFloor:
    """Measure the floor.

    Args:
        found: All records.
        resolution: Of the encoders [rad]; the floor is at least what rounding makes, resolution / sqrt(12).
        least: Least floor of each channel instead, shape (n_channels,).
        held: Indices of records that are held out by a label; they are no repeats of the others, whose difference from
            them is to show.
    """
    least = np.array(max(resolution / np.sqrt(12.0), 1e-5)) if least is None else least
    groups = [group for group in _repeats(found, held) if len(group) > 1]
    if groups:
        spread = [np.array([one.measured[SETTLED:] for one in group]) for group in groups]
        square, slow = _variance(spread), _variance([in_blocks(part).mean(axis=2) for part in spread])
        pairs = sum(len(group) - 1 for group in groups)
        samples = sum(part.shape[1] * (len(part) - 1) for part in spread) * len(square)
        sd = np.maximum(np.sqrt(square), least)
        usual = np.inf if least.ndim else float(np.median(sd))
        unsteady = sd > UNSTEADY * usual
        return NoiseFloor(np.where(unsteady, usual, sd), np.sqrt(slow), unsteady, "repeats", pairs, resolution, samples)
    sd = np.maximum(roughness(found), least)
    return NoiseFloor(sd, np.zeros(len(sd)), np.zeros(len(sd), dtype=bool), "estimated", 0, resolution, ESTIMATE)


def _variance(spread: Sequence[np.ndarray]) -> np.ndarray:
    """Return the variance between repeats, shape (n_joints,), of groups of shapes (repeats, T, n_joints)."""
    total: np.ndarray = np.sum([part.var(axis=0, ddof=1).sum(axis=0) for part in spread], axis=0)
    return total / sum(part.shape[1] for part in spread)


def in_blocks(x: np.ndarray) -> np.ndarray:
    """Return what is of shape (n, T, n_joints) in blocks of MEAN ticks, shape (n, T // MEAN, MEAN, n_joints)."""
    rows = x.shape[1] // MEAN
    return x[:, : rows * MEAN].reshape(len(x), rows, MEAN, -1)


def _repeats(found: Sequence[Record], held: Sequence[int]) -> list[list[Record]]:
    groups: dict[bytes, list[Record]] = defaultdict(list)
    for index, one in enumerate(found):
        if len(one) > 2 * SETTLED:
            apart = repr((one.conditions, index in held)).encode()
            groups[np.round(one.targets, 6).tobytes() + apart].append(one)
    return list(groups.values())


def third_differences(positions: np.ndarray) -> np.ndarray:
    """Return the squares of third differences along the last but one axis, such that white noise has its variance."""
    return np.asarray(np.diff(positions, 3, axis=-2) ** 2 / 20.0)


def roughness(found: Sequence[Record]) -> np.ndarray:
    """Return what encoder noise alone looks like [rad], shape (n_joints,): nothing of it differs between repeats.

    It is the size of third differences where the motion is slow: that of white noise is sqrt(20) times its own.
    """
    rough, speed = [], []
    for one in found:
        rough.append(third_differences(one.measured))
        speed.append(np.abs(np.gradient(one.measured, axis=0)[2:-1]))
    all_rough, all_speed = np.vstack(rough), np.vstack(speed)
    slow = all_speed <= np.quantile(all_speed, QUIET, axis=0)
    return np.sqrt(np.array([np.mean(column[keep]) for column, keep in zip(all_rough.T, slow.T, strict=True)]))
