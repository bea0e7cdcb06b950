"""One episode on a robot: ramp in, act tick by tick behind the guard, stop safely, ramp out; and its rows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gsl.runner.acting import Actor
from gsl.runner.bounds import narrowest
from gsl.runner.clock import Clock, Time
from gsl.runner.following import Following
from gsl.runner.guard import Guard, longest, ramp
from gsl.runner.request import layout_of
from gsl.runner.senses import RobotError, Seen, Senses, names_of
from gsl.runner.watch import FIRST, GivenUp, Watch, limit_of

HOLD = 1.0  # for which the last safe target is held before the ramp out of a stop [s]
LATEST = 3.0  # that a tick may come before the episode is stopped, in periods
ENDS = ("fell", "stopped")  # the last columns
CALM = 0.5  # of a joint's speed limit, the most in a ramp
LONGEST_RAMP = 600.0  # to the start of an episode [s]


class Lies(RobotError):
    """The robot lies down, and nothing more was sent to it."""


class Played(NamedTuple):
    """An episode that is over: columns, rows, and why it ended early, if it did.

    `broken` is Ctrl-C: most often because the robot falls. `late` is the worst delay of a tick [s].
    """

    columns: list[str]
    rows: list[list[Any]]
    fell: bool
    stopped: str
    broken: bool = False
    late: float = 0.0

    def as_a_fall(self) -> Played:
        """Return the same episode, ended by a fall."""
        *rows, last = self.rows
        return self._replace(rows=[*rows, [*last[:-2], True, False]], fell=True)


class Player:
    """Plays the episodes of a request on a robot."""

    def __init__(self, request: Mapping[str, Any], robot: Any, source: Time) -> None:
        limits = narrowest(request["limits"], request["joints"], robot)
        self.request, self.robot, self.period = {**request, "limits": limits}, robot, request["control_period"]
        self.watch, self._reads, self.moving, self._down = Watch(limit_of(robot)), False, False, False
        self.clock = Clock(self.period, source)
        self.guard = Guard(request["joints"], limits, self.period)
        self._following = Following(request["joints"], request["ramp"]["within"])
        self._layout = layout_of(request)
        self._senses = Senses(self._layout)
        self._more: tuple[str, ...] | None = None

    def begin(self, log: Path, columns: Sequence[str] | None) -> None:
        """Read the robot before anything moves, and settle the columns: those of a log if there is one, else its own.

        Raises:
            RobotError: The log lacks what the robot tells, or has what it cannot tell.
        """
        extras = tuple(self._read(self.clock.now()).more)
        self._more = extras
        if columns is None:
            return
        first, last = len(self._columns()) - len(extras) - len(ENDS), len(columns) - len(ENDS)
        self._more = tuple(columns[first:last])
        new = [name for name in extras if name not in self._more]
        gone = [name for name in self._more if name not in extras and name.startswith("base.")]
        if list(columns) != self._columns() or new or gone:
            problem = f"has no column {new[0]}, which" if new else "has other columns than"
            raise RobotError(f"{log}: {problem} the robot tells now; choose another --log")

    def approach(self, episode: Mapping[str, Any]) -> None:
        """Bring the robot from where it is to where the episode starts.

        Raises:
            RobotError: It lies down, is found where nothing should move it, the start is unsafe, or it does not get
                there.
        """
        self.moving = False
        seen = self._read(self.clock.now())
        if seen.fell:
            raise Lies(f"the robot lies down before {episode['name']} has begun; set it up, and start again")
        self._check_told(seen)
        position = self._at(seen)
        if problem := self.guard.beyond(position):
            raise RobotError(f"{problem}; bring it by hand into its range")
        posture = np.array(episode["posture"], dtype=float)
        self.guard.start(posture)
        if problem := self.guard.refusal(posture, 0.0):
            raise RobotError(f"the start of {episode['name']} is refused: {problem}")
        self.guard.start(np.clip(position, self.guard.lower, self.guard.upper))
        self.clock.begin()
        self._ramp(posture)
        self.clock.wait()
        if problem := self.guard.away(self._at(self._read(self.clock.now())), self.request["ramp"]["within"]):
            raise RobotError(f"{problem} after the ramp to the start of {episode['name']}; it is left where it is")
        self.guard.start(posture)

    def play(self, episode: Mapping[str, Any]) -> Played:
        """Act; a fall, a target that is refused or a joint that does not follow ends it early.

        Raises:
            RobotError: The robot or the policy fails, or a tick comes far too late.
        """
        rows, fell, stopped = [], False, ""
        actor = self.watch.call("the policy's start", Actor, self.request, episode, patience=FIRST)
        self._senses = Senses(self._layout)
        self._call("begin", episode)
        self.clock.begin()
        tick, now, broken = 0, 0.0, False
        seen = self._read(now)
        if seen.fell:
            raise Lies(f"the robot lies down before {episode['name']} has begun; set it up, and start again")
        self._following.start(self.guard.last, now)
        try:
            while not (fell := seen.fell) and tick < episode["steps"]:
                self._check_late(episode, now)
                action, sent = self.watch.call("the policy's act", actor.act, seen.observation)
                if stopped := self._following.problem(self._at(seen), now) or self._send(sent):
                    stopped = f"{stopped} (at {now:.2f} s)"
                    break
                rows.append(self._row(episode, tick, now, seen, action, sent))
                tick += 1
                now = self.clock.wait()
                seen = self._read(now)
        except KeyboardInterrupt:
            broken = True
            rows = [row for row in rows if row[2] < now]  # the state after the last action may not have been read yet
            tick = len(rows)
        nothing = np.full(len(self.guard.joints), np.nan)
        rows.append(self._row(episode, tick, now, seen, nothing, nothing, fell=fell, stopped=bool(stopped)))
        return Played(self._columns(), rows, fell, stopped, broken, self.clock.worst)

    def leave(self, episode: Mapping[str, Any], hold: bool) -> None:
        """Bring the robot back to the start posture: hold the last safe target, long where it had to stop, and ramp.

        Where reading hangs it is brought back without, unless it lay down when it was last seen.

        Raises:
            Lies: It lies down; nothing more is sent.
            RobotError: It fails, or does not follow; it is left where it is.
        """
        if not self.moving:
            return
        seconds = HOLD if hold else self.request["limits"]["window"]
        try:
            self._follow([self.guard.last] * max(1, round(seconds / self.period)), held=True, back=True)
            self.guard.start(self.guard.last)
            self._ramp(np.array(episode["posture"], dtype=float), back=True)
        except Lies:
            self._call("end")
            raise
        self._call("end")

    def after_a_hang(self, *, named: bool) -> str:
        """Return what became of the robot after something hung, and what hung unless that was `named`; else nothing."""
        if not self.watch.hung:
            return ""
        unseen = " unseen" if "read" in self.watch.hung else ""
        became = f"the robot was held, then ramped{unseen} to its start" if self.moving else "nothing was sent to it"
        return became if named else f"{' and '.join(f'{name}()' for name in sorted(self.watch.hung))} hangs; {became}"

    def _at(self, seen: Seen) -> np.ndarray:
        return seen.observation[self._layout["position"]]

    def _read(self, now: float) -> Seen:
        seen: Seen = self._watch_over("read", lambda: self._senses.interpret(self.robot.read(), now))
        self._reads, self._down = True, seen.fell
        return seen

    def _look(self, now: float) -> Seen | None:
        """Return what the robot measures on its way back, None where reading hangs."""
        if "read" not in self.watch.hung:
            return self._read(now)
        if self._down:
            raise RobotError("read() hangs and the robot lay down when it was last seen; nothing more is sent to it")
        return None

    def _call(self, name: str, *words: Any) -> None:
        """Call a function of the robot, none where it has none."""
        self._watch_over(name, getattr(self.robot, name, lambda *words: None), *words)

    def _watch_over(self, name: str, function: Callable[..., Any], *words: Any) -> Any:
        """Return what a part of the robot's file returns; the first reading may have to open a connection.

        Raises:
            RobotError: It fails, or calls sys.exit(): nothing in it ends the runner while the robot is away.
        """
        slow = name in ("begin", "end") or (name == "read" and not self._reads)
        try:
            return self.watch.call(name, function, *words, patience=FIRST if slow else 1.0)
        except (RobotError, KeyboardInterrupt, GivenUp):
            raise
        except BaseException as error:
            raise RobotError(f"{name}() failed: {type(error).__name__}: {error}") from error

    def _send(self, target: np.ndarray) -> str:
        """Send a target that is safe, and not too soon; return why it is refused, nothing if it was sent."""
        now = self.clock.apart()
        if problem := self.guard.refusal(target, now):
            return problem
        self.guard.take(target, now)  # first: if send() breaks off, the robot may have it
        self._following.note(target, now)
        self.moving = True
        self._call("send", target.copy())
        return ""

    def _check_late(self, episode: Mapping[str, Any], now: float) -> None:
        if self.clock.late > LATEST * self.period:
            late = f"at {now:.2f} s a tick came {1e3 * self.clock.late:.0f} ms late"
            raise RobotError(f"{episode['name']}: {late}; stopped and not kept; run it again")

    def _ramp(self, end: np.ndarray, *, back: bool = False) -> None:
        speed = np.minimum(self.request["ramp"]["speed"], CALM * np.array(self.request["limits"]["speed"]))
        seconds = longest(self.guard.last, end, speed)
        if seconds > LONGEST_RAMP and not back:
            raise RobotError(
                f"a ramp would take {seconds:.3g} s, more than {LONGEST_RAMP:g} s: a speed limit is too low"
            )
        self._follow(ramp(self.guard.last, end, self.request["ramp"]["seconds"], speed, self.period), back=back)

    def _follow(self, targets: Iterable[np.ndarray], *, held: bool = False, back: bool = False) -> None:
        """Send targets one by one while the robot stands and, unless one and the same is `held`, follows.

        On the way `back` it is gone on where reading hangs.
        """
        self._following.start(self.guard.last, self.clock.now())
        for target in targets:
            now = self.clock.wait()
            seen = self._look(now) if back else self._read(now)
            if seen and seen.fell:
                raise Lies("the robot lies down; nothing more is sent to it")
            if seen and not held and (problem := self._following.problem(self._at(seen), now)):
                raise RobotError(f"{problem} in a ramp; it is left where it is")
            if problem := self._send(target):
                raise RobotError(f"a ramp is refused: {problem}")

    def _check_told(self, seen: Seen) -> None:
        """Refuse what the robot did not tell at first; what is missing now is left blank, but never the base."""
        if self._more is None:
            self._more = tuple(seen.more)
        for name in seen.more:
            if name not in self._more:
                raise RobotError(f"read() gives {name} now, which it did not at first; choose another --log")

    def _columns(self) -> list[str]:
        groups = ("action", "grounded_action") if self.request["action_noise"] else ("action",)
        asked = [f"{group}.{joint}" for group in groups for joint in self.guard.joints]
        return ["episode", "step", "time", *asked, *names_of(self._layout), *(self._more or ()), *ENDS]

    def _read_senses(self, seen: Seen) -> list[float]:
        """Return what the robot tells beyond the request, in order."""
        for name in self._more or ():
            if name not in seen.more and name.startswith("base."):
                raise RobotError(f"read() gives no {name} any more; without it nobody knows how far it came")
        return [seen.more.get(name, np.nan) for name in self._more or ()]

    def _row(
        self, episode: Mapping[str, Any], tick: int, now: float, seen: Seen, action: np.ndarray, sent: np.ndarray,
        *, fell: bool = False, stopped: bool = False,
    ) -> list[Any]:  # fmt: skip
        asked = [*action.tolist(), *(sent.tolist() if self.request["action_noise"] else ())]
        number = self.request["episodes"].index(episode)
        return [number, tick, now, *asked, *seen.observation.tolist(), *self._read_senses(seen), fell, stopped]
