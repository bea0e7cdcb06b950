"""The guard between policy and robot: it refuses a target that is not finite, out of range, or too far from the last.

lower <= target <= upper,    change in a tick <= step,    way within a window of time <= path
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

_ROUNDING = 1e-9
BEYOND = 0.1  # how far outside of its range a joint may be found before a ramp [rad]


class Guard:
    """Watches the targets of one robot.

    Args:
        joints: Their names.
        limits: `lower`, `upper` [rad], `step` [rad] and `path` [rad], one value a joint, and `window` [s].
        period: Control period [s].
    """

    def __init__(self, joints: Sequence[str], limits: Mapping[str, Any], period: float) -> None:
        self.joints, self._period = tuple(joints), period
        self.lower, self.upper, self.step, self.path = (
            np.array(limits[name], dtype=float) for name in ("lower", "upper", "step", "path")
        )
        self._window = float(limits["window"])
        self.start(np.clip(np.zeros(len(self.joints)), self.lower, self.upper))

    def start(self, target: np.ndarray) -> None:
        """Forget the past: the robot rests at a target [rad], shape (n_joints,)."""
        self.last = target.copy()
        self._ways: deque[tuple[float, np.ndarray]] = deque()

    def refusal(self, target: np.ndarray, now: float) -> str:
        """Return why a target [rad], shape (n_joints,), must not be sent at a time [s], nothing if it may."""
        if target.shape != self.last.shape:
            return f"{len(self.joints)} targets are due, one a joint, not {target.size}"
        if not np.isfinite(target).all():
            return self._report(~np.isfinite(target), "the target is not a finite number")
        change = np.abs(target - self.last)
        since = now - self._window + 0.5 * self._period  # ticks are not to the microsecond
        way = sum((way for at, way in self._ways if at > since), change)
        seconds = f"{self._window:g} s"
        rules = (
            (target, self.lower, -1.0, "the target of {:.4g} rad is below the limit of {:.4g} rad"),
            (target, self.upper, 1.0, "the target of {:.4g} rad is above the limit of {:.4g} rad"),
            (change, self.step, 1.0, "the target jumps by {:.4g} rad, more than the {:.4g} rad allowed"),
            (way, self.path, 1.0, "the target moves {:.4g} rad in " + seconds + ", more than the {:.4g} rad allowed"),
        )
        reasons = (
            self._report(~(sign * (value - bound) <= _ROUNDING), text, value, bound)
            for value, bound, sign, text in rules
        )
        return next(filter(None, reasons), "")

    def take(self, target: np.ndarray, now: float) -> None:
        """Remember a target that was sent [rad], shape (n_joints,), at a time [s]."""
        self._ways.append((now, np.abs(target - self.last)))
        while self._ways[0][0] < now - self._window:
            self._ways.popleft()
        self.last = target.copy()

    def beyond(self, position: np.ndarray) -> str:
        """Return which joint was found so far outside of its range that nothing should move it, nothing if none."""
        outside = np.maximum(self.lower - position, position - self.upper)
        return self._report(
            ~(outside <= BEYOND), "is at {:.4g} rad, {:.4g} rad outside of its range", position, outside
        )

    def away(self, position: np.ndarray, within: float) -> str:
        """Return which joint is further from the last target than `within` [rad], nothing if none is."""
        off = np.abs(position - self.last)
        return self._report(~(off <= within), "is {:.4g} rad off", off)

    def _report(self, wrong: np.ndarray, text: str, *values: np.ndarray) -> str:
        if not wrong.any():
            return ""
        joint = int(np.argmax(wrong))
        return f"{self.joints[joint]}: {text.format(*(value[joint] for value in values))}"


def ramp(start: np.ndarray, end: np.ndarray, seconds: float, speed: np.ndarray, period: float) -> Iterator[np.ndarray]:
    """Yield the targets of a smooth way from one posture to another, the end included.

        target = start + (end - start) (1 - cos(pi t / T)) / 2

    Args:
        start: [rad], shape (n_joints,).
        end: [rad], shape (n_joints,).
        seconds: The least duration [s].
        speed: The most of each joint [rad/s], shape (n_joints,).
        period: Control period [s].
    """
    ticks = max(1, math.ceil(max(seconds, longest(start, end, speed)) / period - _ROUNDING))
    for tick in range(1, ticks + 1):
        yield start + (end - start) * (0.5 - 0.5 * np.cos(np.pi * tick / ticks))


def longest(start: np.ndarray, end: np.ndarray, speed: np.ndarray) -> float:
    """Return how long the slowest joint needs for a ramp [s]; arguments as those of `ramp`."""
    with np.errstate(over="ignore"):
        return 0.5 * np.pi * float((np.abs(end - start) / speed).max())
