"""How far work is that consists of parts, whose loops have steps, and how long the rest of it will take."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

from gsl.core.compiling import is_compiling
from gsl.core.words import duration, falls

COMPILING = "compiling, once after an installation"
PRIOR = 0.05  # of the whole work: so much of it has to be done until the clock counts as much as the plan


class Part(NamedTuple):
    """A part of planned work: about how long it takes [s], 0 if nobody knows, and how many steps its loops have."""

    seconds: float = 0.0
    steps: int = 0


@dataclass
class Plan:
    """Parts that are done one after the other; none where nobody knows how many there are."""

    noun: str
    parts: Sequence[Part]
    name: str = ""
    at: int = 0
    steps: int = 0

    @property
    def seconds(self) -> float:
        """About how long all of it takes [s]; 0 if nobody knows."""
        return sum(part.seconds for part in self.parts)

    def share(self, inside: float) -> float:
        """Return how much is done, 0 to 1, if so much of the present part is."""
        if not self.parts:
            return 0.0
        costs = [part.seconds for part in self.parts] if self.seconds else [1.0] * len(self.parts)
        return min(1.0, (sum(costs[: self.at]) + inside * sum(costs[self.at : self.at + 1])) / sum(costs))

    def inside(self) -> float:
        """Return how much of the present part its steps are, 0 to 1."""
        total = self.parts[self.at].steps if self.at < len(self.parts) else 0
        return min(1.0, self.steps / total) if total else 0.0

    def words(self) -> str:
        """Return at which part the work is."""
        many = f" of {len(self.parts)}" if self.parts else ""
        number = min(self.at + 1, len(self.parts) or self.at + 1)
        return f"{self.noun} {number}{many}" + (f" ({self.name})" if self.name else "")


class Loop:
    """A loop of so many steps."""

    def __init__(self, work: Workload, total: int, description: str) -> None:
        self._work, self._total, self._description = work, total, description
        self._begun: float | None = None  # when its first step was done, in whose time workers start
        self._done, self._worked, self._falls = 0, 0, 0

    def advance(self, steps: int = 1, *, worked: bool = True) -> None:
        """Note that `steps` more are done; without work if they were done before."""
        self._done += steps
        if worked and self._begun is None:
            self._begun = self._work.measure_work()
        elif worked:
            self._worked += steps
        self._work.step(steps, worked=worked)

    def fell(self, count: int) -> None:
        """Note that the robot fell so often."""
        self._falls += count

    def best(self, text: str) -> None:
        """Note the best value so far, in words."""
        self._work.best = text

    def words(self) -> list[str]:
        """Return how far it is, and how fast."""
        passed = 0.0 if self._begun is None else self._work.measure_work() - self._begun
        rate = self._worked / passed if passed > 0.0 else 0.0
        speed = f"{rate:.1f} a second" if rate >= 1.0 else f"{1.0 / rate:.1f} s each" if rate else ""
        return [f"{self._description}: {self._done} of {self._total}", speed]

    def falls(self) -> str:
        """Return how often the robot fell, nothing if it did not."""
        return falls(self._falls) if self._falls else ""


class Workload:
    """Where nested work is; `changed` is called whenever that changes."""

    def __init__(self, changed: Callable[[], None], clock: Callable[[], float] | None = None) -> None:
        self.clock, self.best = clock or time.monotonic, ""
        self._changed = changed
        self._plans: list[Plan] = []
        self._loop: Loop | None = None
        self._alone = self._warm = False
        self._share = self._free = self._begun = self._last = 0.0
        self._phase, self._entered = "", 0.0
        self._around = "", 0.0  # name of the work, and since when, for when no phase of it has begun
        self._looking, self._looked = threading.Lock(), self.clock()
        self._compiling, self._compiled = False, 0.0

    def measure_work(self) -> float:
        """Return the clock without the time in which something was compiled [s], as far as somebody looked."""
        with self._looking:
            now, compiling = self.clock(), is_compiling()
            if compiling or self._compiling:
                self._compiled += now - self._looked
            self._looked, self._compiling = now, compiling
            return now - self._compiled

    @contextmanager
    def plan(self, noun: str, parts: Sequence[Part]) -> Iterator[None]:
        """Within, the work, or the present part of the plan around, consists of such parts."""
        if not self._plans:
            self._share = self._free = 0.0
            self._begun = self._last = self.measure_work()
            self.best, self._warm = "", False
        self._plans.append(Plan(noun, parts))
        try:
            yield
        finally:
            self._plans.pop()

    @contextmanager
    def at_work(self, name: str) -> Iterator[None]:
        """Within, the work has this name wherever nobody knows more of it."""
        before = self._phase, self._entered, self._around
        self._phase, self._around = "", (name, self.clock())
        try:
            yield
        finally:
            self._phase, self._entered, self._around = before

    def enter(self, phase: str) -> None:
        """Name what is done now; how long it takes is not known."""
        self._phase, self._entered = phase, self.clock()
        self._changed()

    @property
    def has_plan(self) -> bool:
        """Whether somebody knows how long the present part takes."""
        return any(plan.seconds for plan in self._plans)

    def begin(self, name: str) -> None:
        """Name the part that begins."""
        if self._plans and not self._alone:
            self._plans[-1].name = name
            self._phase = ""
            self._changed()

    def finish(self, *, worked: bool = True) -> None:
        """Note that a part is done; without work if it was done before."""
        if self._plans and not self._alone:
            plan = self._plans[-1]
            plan.at, plan.steps, plan.name, self._phase = plan.at + 1, 0, "", ""
            self._move(worked=worked)

    @contextmanager
    def loop(self, total: int, description: str) -> Iterator[Loop]:
        """Within, the present part is a loop, or the whole work is if there is no plan."""
        if not self._plans:
            self._alone = True
            try:
                with self.plan("", [Part(0.0, total)]), self.loop(total, description) as loop:
                    yield loop
            finally:
                self._alone = False
            return
        before, self._loop = self._loop, Loop(self, total, description)
        try:
            yield self._loop
        finally:
            self._loop, self._phase = before, ""  # what was done before the loop is long over

    def step(self, steps: int, *, worked: bool) -> None:
        """Note steps of the present loop."""
        self._plans[-1].steps += steps
        self._move(worked=worked)

    @property
    def share(self) -> float:
        """How much of all is done, 0 to 1."""
        return self._share

    def left(self) -> float | None:
        """Return how long the rest takes [s], None if that cannot be said yet.

        Compilation does not count, nor does the first step that was worked, in whose time workers start.
        A part that takes longer than planned leaves the time of the parts after it as it is.
        """
        seconds = self._plans[0].seconds if self._plans else 0.0
        prior = PRIOR if seconds else 0.0
        weight = self._share - self._free + prior
        if weight <= 0.0:
            return None
        whole = (self._last - self._begun + prior * seconds) / weight
        passed = min(self.measure_work() - self._last, whole * (self._end() - self._share))
        return max(0.0, whole * (1.0 - self._share) - passed)

    def _end(self) -> float:
        """Return how much of all is done at the end of the present part."""
        inside = 1.0
        for plan in reversed(self._plans):
            inside = plan.share(inside) if plan.parts else inside
        return max(inside, self._share)

    def text(self) -> str:
        """Return in a line where the work is, how much is done, how fast it goes and what has come out."""
        plans, loop, left, compiling = [*self._plans], self._loop, self.left(), is_compiling()
        whole = [f"{100.0 * self._share:.0f} % done"] if plans and plans[0].parts else []
        whole += [f"about {duration(left)} left"] if left and left >= 0.5 and not compiling else []
        name, since = (self._phase, self._entered) if self._phase or plans else self._around
        phase = [] if loop or not name else [name, duration(self.clock() - since)]
        places = [*(plan.words() for plan in plans if plan.noun), *(loop.words() if loop else phase)]
        places += [COMPILING] if compiling else []
        outcome = [self.best, loop.falls() if loop else ""] if plans else []
        return "; ".join(filter(None, (", ".join(filter(None, words)) for words in (whole, places, outcome))))

    def _move(self, *, worked: bool) -> None:
        inside = self._plans[-1].inside()
        for plan in reversed(self._plans):
            inside = plan.share(inside)
        moved = max(0.0, inside - self._share)
        self._share += moved
        self._last = self.measure_work()
        if not (worked and self._warm):
            self._free += moved
        if worked and not self._warm:
            self._begun, self._warm = self._last, True
        self._changed()
