"""Watches whether a robot goes where it is sent: no joint far from its targets, none that stands still.

distance from position to [min, max] of the targets of the last LAG seconds <= far
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

LAG = 0.3  # by which a joint may be behind its targets [s]
WHILE = 1.0  # over which a joint must have moved at all [s]
FAR = 0.4  # the least that a joint may be off its targets [rad]
STILL = 0.1  # of `within`, less than which no joint moves that is sent further than `within`


class Following:
    """Remembers the targets and positions of the last second.

    Args:
        joints: Their names.
        within: How near a joint must be to a target that it had the time to reach [rad].
    """

    def __init__(self, joints: Sequence[str], within: float) -> None:
        self._joints, self._within = tuple(joints), within
        self._far = max(FAR, 2.0 * within)
        self.start(np.zeros(len(self._joints)), 0.0)

    def start(self, target: np.ndarray, now: float) -> None:
        """Forget the past: the robot was sent a target [rad], shape (n_joints,), at a time [s]."""
        self._targets = deque([(now, target.copy())])
        self._positions: deque[tuple[float, np.ndarray]] = deque()

    def note(self, target: np.ndarray, now: float) -> None:
        """Remember a target [rad], shape (n_joints,), sent at a time [s]."""
        self._targets.append((now, target.copy()))
        while len(self._targets) > 1 and self._targets[1][0] < now - WHILE:  # the one before holds until then
            self._targets.popleft()

    def problem(self, position: np.ndarray, now: float) -> str:
        """Return which joint does not follow, being at a position [rad], shape (n_joints,), nothing if all do."""
        self._positions.append((now, position.copy()))
        while self._positions[0][0] < now - WHILE:
            self._positions.popleft()
        targets = np.array([target for _, target in self._targets])
        ends = np.array([at for at, _ in self._targets][1:] + [np.inf])  # until when each of them was the last
        recent = targets[ends >= now - LAG]
        off = np.maximum(recent.min(axis=0) - position, position - recent.max(axis=0))
        if (off > self._far).any():
            joint = int(np.argmax(off))
            return f"{self._joints[joint]}: is {off[joint]:.3g} rad off its targets"
        settled = np.array([target for at, target in self._targets if at <= now - LAG] or [position])
        sent = np.ptp(settled, axis=0)
        moved = np.ptp(np.array([position for _, position in self._positions]), axis=0)
        still = (sent > self._within) & (moved < STILL * self._within)
        if still.any():
            joint = int(np.argmax(still * sent))
            return f"{self._joints[joint]}: stands still, though it was sent {sent[joint]:.3g} rad away"
        return ""
