"""One episode on a robot: ramp in, act tick by tick behind the guard, stop safely, ramp out; and its rows."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from gsl.runner.acting import Actor
from gsl.runner.guard import Guard, ramp
from gsl.runner.request import layout_of
from gsl.runner.senses import RobotError, Seen, Senses, names_of

HOLD = 1.0  # for which the last safe target is held before the ramp out of a stop [s]


class Clock:
    """Ticks of a control period [s]: it waits for each, or, not `paced`, says that it came when it was due."""

    def __init__(self, period: float, *, paced: bool) -> None:
        self._period, self._paced = period, paced
        self.worst = 0.0
        self.begin()

    def begin(self) -> None:
        """Let tick 0 be now."""
        self._start, self.worst = time.perf_counter(), 0.0

    def wait(self, tick: int) -> float:
        """Wait for a tick and return the time since the beginning [s]; `worst` is the greatest delay so far [s]."""
        due = self._period * tick
        if not self._paced:
            return due
        late = time.perf_counter() - self._start - due
        if late < 0.0:
            time.sleep(-late)
        self.worst = max(self.worst, late)
        return time.perf_counter() - self._start


class Played(NamedTuple):
    """An episode that is over: columns, rows, and why it ended early, if it did; `broken` is Ctrl-C.

    A person breaks it off, most often, because the robot falls.
    """

    columns: list[str]
    rows: list[list[Any]]
    fell: bool
    stopped: str
    broken: bool = False

    def as_a_fall(self) -> Played:
        """Return the same episode, ended by a fall."""
        *rows, last = self.rows
        return self._replace(rows=[*rows, [*last[:-2], True, False]], fell=True)


class Player:
    """Plays the episodes of a request on a robot."""

    def __init__(self, request: Mapping[str, Any], robot: Any, *, paced: bool) -> None:
        self.request, self.robot, self.period = request, robot, request["control_period"]
        self.clock = Clock(self.period, paced=paced)
        self.guard = Guard(request["joints"], request["limits"], self.period)
        self._layout = layout_of(request)
        self._senses = Senses(self._layout)

    def approach(self, episode: Mapping[str, Any]) -> None:
        """Bring the robot from where it is to where the episode starts.

        Raises:
            RobotError: It is found where nothing should move it, or the start is unsafe.
        """
        position = self._read().observation[self._layout["position"]]
        if problem := self.guard.beyond(position):
            raise RobotError(f"{problem}; bring it by hand into its range")
        posture = np.array(episode["posture"], dtype=float)
        self.guard.start(posture)
        if problem := self.guard.refusal(posture):
            raise RobotError(f"the start of {episode['name']} is refused: {problem}")
        self._ramp(np.clip(position, self.guard.lower, self.guard.upper), posture)
        self.guard.start(posture)

    def play(self, episode: Mapping[str, Any]) -> Played:
        """Act; a fall or a target that is refused ends it early, the last safe target is then held."""
        actor, rows, fell, stopped = Actor(self.request, episode), [], False, ""
        self._senses = Senses(self._layout)
        getattr(self.robot, "begin", lambda episode: None)(episode)
        self.clock.begin()
        tick, now, seen, broken = 0, 0.0, self._read(), False
        if seen.fell:
            raise RobotError(f"the robot lies down before {episode['name']} has begun")
        try:
            while not (fell := seen.fell) and tick < episode["steps"]:
                action, sent = actor.act(seen.observation)
                if stopped := self.guard.refusal(sent):
                    stopped = f"{stopped} (at {now:.2f} s)"
                    break
                self._send(sent)
                self.guard.take(sent)
                rows.append(self._row(episode, tick, now, seen, action, sent))
                tick += 1
                now, seen = self.clock.wait(tick), self._read()
        except KeyboardInterrupt:
            broken = True
            rows = [row for row in rows if row[2] < now]  # the state after the last action may not have been read yet
            tick = len(rows)
        nothing = np.full(len(self.guard.joints), np.nan)
        rows.append(self._row(episode, tick, now, seen, nothing, nothing, fell=fell, stopped=bool(stopped)))
        return Played(self._columns(seen), rows, fell, stopped, broken)

    def leave(self, episode: Mapping[str, Any], *, hold: bool) -> None:
        """Bring the robot back to the start posture, first holding the last safe target where it had to stop."""
        if hold:
            self._follow([self.guard.last] * max(1, round(HOLD / self.period)))
        self._ramp(self.guard.last, np.array(episode["posture"], dtype=float))
        getattr(self.robot, "end", lambda: None)()

    def _read(self) -> Seen:
        try:
            told = self.robot.read()
        except Exception as error:
            raise RobotError(f"read() failed: {type(error).__name__}: {error}") from error
        return self._senses.seen(told)

    def _send(self, targets: np.ndarray) -> None:
        try:
            self.robot.send(targets.copy())
        except Exception as error:
            raise RobotError(f"send() failed: {type(error).__name__}: {error}") from error

    def _ramp(self, start: np.ndarray, end: np.ndarray) -> None:
        self._follow(list(ramp(start, end, self.request["ramp"], self.period)))

    def _follow(self, targets: list[np.ndarray]) -> None:
        self.clock.begin()
        for tick, target in enumerate(targets):
            self.clock.wait(tick)
            self._send(target)
        self.guard.start(targets[-1])

    def _columns(self, seen: Seen) -> list[str]:
        groups = ("action", "grounded_action") if self.request["action_noise"] else ("action",)
        asked = [f"{group}.{joint}" for group in groups for joint in self.guard.joints]
        return ["episode", "step", "time", *asked, *names_of(self._layout), *seen.more, "fell", "stopped"]

    def _row(
        self, episode: Mapping[str, Any], tick: int, now: float, seen: Seen, action: np.ndarray, sent: np.ndarray,
        *, fell: bool = False, stopped: bool = False,
    ) -> list[Any]:  # fmt: skip
        asked = [*action.tolist(), *(sent.tolist() if self.request["action_noise"] else ())]
        number = self.request["episodes"].index(episode)
        return [number, tick, now, *asked, *seen.observation.tolist(), *seen.more.values(), fell, stopped]
