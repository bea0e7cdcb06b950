"""The clock of an episode: ticks a control period apart, and targets never much closer, however late one comes.

due = end of the tick before + period,    from a late tick on counted anew
time between two targets >= 0.9 period
"""

from __future__ import annotations

import time

LEAST = 0.9  # time between two targets, in periods
SLACK = 1.0 - LEAST  # by which a tick may be late and the next still be due when it was, in periods


class Wall:
    """The time on the wall."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Let it be 0 now."""
        self._zero = time.perf_counter()

    def now(self) -> float:
        """Return the time since `restart` [s]."""
        return time.perf_counter() - self._zero

    def until(self, due: float) -> None:
        """Sleep until a time [s]."""
        while (rest := due - self.now()) > 0.0:
            time.sleep(rest)


class Simulated:
    """Time that passes only where somebody waits for it."""

    def __init__(self) -> None:
        self._now = 0.0

    def restart(self) -> None:
        """Let it be 0 now."""
        self._now = 0.0

    def now(self) -> float:
        """Return the time since `restart` [s]."""
        return self._now

    def until(self, due: float) -> None:
        """Let it be a time [s], without waiting."""
        self._now = max(self._now, due)


Time = Wall | Simulated


class Clock:
    """Ticks of a control period [s]."""

    def __init__(self, period: float, source: Time) -> None:
        self._period, self._time = period, source
        self._sent = -float("inf")
        self.begin()

    def begin(self) -> None:
        """Let tick 0 be now, or a period after the last target."""
        self._time.until(self._sent + self._period)
        self._time.restart()
        self._anchor, self._tick, self._sent = 0.0, 0, -self._period
        self.late = self.worst = 0.0

    def now(self) -> float:
        """Return the time since tick 0 [s]."""
        return self._time.now()

    def wait(self) -> float:
        """Wait for the next tick and return its time [s]; `late` is its delay, `worst` the greatest so far [s]."""
        self._tick += 1
        due = self._anchor + self._period * self._tick
        self._time.until(due)
        now = self._time.now()
        self.late = now - due
        self.worst = max(self.worst, self.late)
        if self.late > SLACK * self._period:
            self._anchor, self._tick = now, 0
        return now

    def apart(self) -> float:
        """Wait until a target may follow the last one, and return the time at which it does [s]."""
        self._time.until(self._sent + LEAST * self._period)
        self._sent = self._time.now()
        return self._sent
