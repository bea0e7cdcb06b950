"""The runner: plays the episodes of a request on a robot, one after the other, and writes the answer beside it."""

from __future__ import annotations

import argparse
import signal
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from gsl.errors import GslError
from gsl.runner import bounds, journal
from gsl.runner.clock import Simulated, Wall
from gsl.runner.episode import Lies, Played, Player
from gsl.runner.preflight import alone, check_writable, mend
from gsl.runner.request import due, read_request
from gsl.runner.robots import PerfectRobot, robot_of
from gsl.runner.saying import say
from gsl.runner.senses import RobotError
from gsl.runner.watch import SIGNALS, Hangs

LATE = 0.002  # of a tick, that is worth telling [s]
OFF = 0.5  # of a tick, from which on a log is refused, in periods
MOST = 100.0  # that a robot may walk in an episode [m]


def main(folder: Path, words: Sequence[str]) -> int:
    """Run the command line of the runner in a request's folder and return its exit code."""
    parser = argparse.ArgumentParser(prog="runner.py", description=__doc__)
    parser.add_argument("--robot", type=Path, default=folder / "robot.py", help="file with read() and send()")
    parser.add_argument("--log", type=Path, default=folder / journal.ANSWER, help="the answer")
    parser.add_argument("--episode", action="append", metavar="NAME", help="run this one only, again if it was run")
    parser.add_argument("--dry-run", action="store_true", help="play against a perfect robot; nothing is written")
    parser.add_argument("--yes", action="store_true", help="ask nothing")
    parser.add_argument("--unpaced", action="store_true", help="do not wait for the clock: for a simulated robot")
    parser.add_argument("--trust", action="append", default=[], metavar="MODULE", help="whose policy may be run")
    asked = parser.parse_args(words)
    for name in SIGNALS:  # hold, ramp out, keep what is complete; in a background job as well
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.default_int_handler)
    asked.log = asked.log.absolute()  # a robot's file may change the current folder
    try:
        request = read_request(folder, asked.trust)
        if asked.dry_run:
            return dry_run(request)
        with alone(folder):
            return Sitting(request, asked).run()
    except GslError as error:
        say(" ".join(f"runner.py: {error}".splitlines()))
        return 2
    except OSError as error:
        say(f"runner.py: {error.filename or 'a file'} cannot be read or written: {error.strerror or error}")
        return 2
    except KeyboardInterrupt as error:
        say("; ".join(["runner.py: interrupted", *map(str, error.args), "what was complete is kept"]))
        return 130


def dry_run(request: Mapping[str, Any]) -> int:
    """Play every episode against a perfect robot and tell rates and extremes; return 1 if a target is refused."""
    robot = PerfectRobot(request)
    stage, ticks, stops = Player(request, robot, Simulated()), 0, 0
    begin = time.perf_counter()
    for episode in request["episodes"]:
        stage.approach(episode)
        played = stage.play(episode)
        ticks, stops = ticks + len(played.rows), stops + bool(played.stopped)
        if played.stopped:
            say(f"{episode['name']}: refused: {played.stopped}")
        stage.leave(episode, hold=bool(played.stopped))
    each = (time.perf_counter() - begin) / ticks
    say("\n".join(robot.rows()))
    needed = request["control_period"]
    say(f"{ticks} steps, {1e3 * each:.2f} ms each of the {1e3 * needed:g} ms there are ({1 / needed:g} Hz)")
    result = f"{stops} of {len(request['episodes'])} episodes were refused" if stops else "no target was refused"
    say(f"{result}; nothing was written. A real robot feels its feet and sways: its targets will differ.")
    return 1 if stops else 0


class NobodyToAsk(GslError):
    """There is nobody to ask."""


class Sitting:
    """What is run of a request in one go."""

    def __init__(self, request: Mapping[str, Any], asked: argparse.Namespace) -> None:
        self._request, self._asked = request, asked
        self._returns = asked.log.with_name(journal.RETURNS)
        check_writable(asked.log)
        journal.check_mark(asked.log, request["hash"])
        journal.check_mark(self._returns, request["hash"], by_hand=True)
        names = [episode["name"] for episode in request["episodes"]]
        for name in asked.episode or ():
            if name not in names:
                raise RobotError(f"there is no episode {name}; there is {', '.join(names)}")
        robot = robot_of(asked.robot)
        if asked.unpaced and not getattr(robot, "SIMULATED", False):
            raise RobotError(f"--unpaced is for a rehearsal; {asked.robot} does not say SIMULATED = True")
        if not (hasattr(robot, bounds.NAME) or asked.unpaced):
            say(f"{asked.robot} has no {bounds.NAME}: those of the request alone count")
        self._player = Player(request, robot, Simulated() if asked.unpaced else Wall())
        self._watched = self._player.watch.run

    def run(self) -> int:
        """Run the episodes that are missing, or those that were named."""
        say(self._request["about"])
        if message := mend(self._asked.log, self._request):
            say(message)
        log = self._asked.log
        self._watched(self._player.begin, log, journal.table(log)[0] if log.exists() else None)
        if not self._asked.episode:
            for episode in self._list_unmeasured():
                say(f"{episode['name']} is logged, but nobody has said how far it came")
                self._measure(episode, fell=False)
        for episode in self._sitting():
            if not self._ask(f"{episode['name']} ({self._seconds(episode):g} s): Enter ramps in, q ends"):
                break
            self._one(episode)
        self._tell_missing()
        return 0

    def _tell_missing(self) -> None:
        missing, unmeasured = self._due(), ", ".join(episode["name"] for episode in self._list_unmeasured())
        if missing:
            say(f"{len(missing)} episodes are missing")
        if unmeasured:
            say(f"distances are missing: {unmeasured}; start again without --yes, or write them into {self._returns}")
        if not missing and not unmeasured:
            say(f"all is answered: {self._asked.log}")

    def _list_unmeasured(self) -> list[Mapping[str, Any]]:
        """Return the logged episodes, without a fall, of which nobody knows how far they came."""
        log, episodes = self._asked.log, self._request["episodes"]
        if not self._request["distance"] or not log.exists() or "base.position.x" in journal.table(log)[0]:
            return []
        returns = journal.read_returns(self._returns)
        measured = {name for name, row in returns.items() if row.get("distance") or row.get("value") or _fell(row)}
        standing = [episodes[number] for number, down in sorted(journal.ends(log).items()) if not down]
        return [episode for episode in standing if episode["name"] not in measured]

    def _one(self, episode: Mapping[str, Any]) -> None:
        """Run an episode; what it came to is written before the robot moves on, as that may fail, too."""
        player, played, fault, hold = self._player, None, None, True
        try:
            self._watched(player.approach, episode)
        except (Hangs, KeyboardInterrupt) as error:
            if not player.watch.hung:
                raise
            raise _both(error, self._back(episode, error, down=False, hold=True)) from error
        try:
            if not self._ask("it stands at the start: Enter begins, q ends"):
                hold = False
                raise KeyboardInterrupt
            played = self._watched(player.play, episode)
            hold = played.fell or played.broken or bool(played.stopped)
            if not played.broken:
                self._keep(episode, played)
        except BaseException as error:  # whatever it is, the robot is brought back first
            fault = error
        down = played is not None and (played.fell or bool(played.stopped))
        left = self._back(episode, fault, down=down, hold=hold)
        if played is not None and played.broken:
            try:
                self._keep(episode, self._ask_why_broken(played))
            except BaseException as error:
                fault = error
        if fault is not None or left:
            raise _both(fault, left)
        assert played is not None
        if self._request["distance"] and "base.position.x" not in played.columns:
            self._measure(episode, fell=played.fell or bool(played.stopped))

    def _back(self, episode: Mapping[str, Any], fault: BaseException | None, *, down: bool, hold: bool) -> str:
        """Hold and ramp out; return why the robot is not back, nothing if it is, or lies after what was a fall.

        Where something hangs, what became of the robot is told in any case.

        Raises:
            KeyboardInterrupt: The way back was broken off, after an episode without a fault.
        """
        try:
            try:
                self._watched(self._player.leave, episode, hold)
            except Hangs as error:
                if error.name != "read":
                    raise
                self._watched(self._player.leave, episode, hold)  # without reading
            return self._player.after_a_hang(named=isinstance(fault, Hangs))
        except KeyboardInterrupt as error:
            left = f"{episode['name']}: the way back was broken off; the robot is left where it is"
            if fault is None:
                raise KeyboardInterrupt(left) from error
            return left
        except Lies as error:
            if not down:
                return f"{episode['name']}: {error}"
            say(f"{episode['name']}: {error}; set it up")
        except GslError as error:
            return f"{episode['name']}: could not be brought back: {error}"
        return ""

    def _keep(self, episode: Mapping[str, Any], played: Played) -> None:
        """Write down what an episode came to: its log, or that it fell where there is none that could be used."""
        late = f"{1e3 * played.late:.0f} ms late at worst"
        useless = played.late > OFF * self._request["control_period"]
        if useless and not (played.fell or played.stopped):
            raise RobotError(f"{episode['name']}: {late}; not kept; run it again where the rate is kept")
        if useless or len(played.rows) == 1:  # nothing was sent, or not at the rate
            journal.drop(self._asked.log, self._request["episodes"].index(episode))
            journal.add_return(self._returns, self._request["hash"], episode["name"], "", fell=True)
        else:
            journal.forget(self._returns, episode["name"])
            journal.keep(self._asked.log, self._request["hash"], played.columns, played.rows)
        ended = f"; refused: {played.stopped}; held, then ramped out" if played.stopped else ""
        delay = f", {late}" if played.late > LATE else ""
        say(f"{episode['name']}: {len(played.rows) - 1} steps{delay}{', fell' * played.fell}{ended}")

    def _ask_why_broken(self, played: Played) -> Played:
        """Ask why a person broke an episode off: a fall is a result and must not be lost, anything else is none."""
        with suppress(NobodyToAsk):
            if len(played.rows) > 1 and not self._asked.yes and self._yes("was it a fall? y keeps it, n runs it again"):
                return played.as_a_fall()
        raise KeyboardInterrupt

    def _measure(self, episode: Mapping[str, Any], *, fell: bool) -> None:
        """Ask a person for what the robot cannot tell."""
        if self._asked.yes:
            return
        question = "distance walked forward [m], f if it fell, Enter to write it into returns.csv later: "
        while not _is_distance(answer := _read_line(question)):
            say(f"'{answer}' is no number of metres")
        if answer:
            fallen = answer == "f"
            journal.add_return(
                self._returns, self._request["hash"], episode["name"], "" if fallen else answer, fell=fell or fallen
            )

    def _sitting(self) -> Iterator[Mapping[str, Any]]:
        """Yield those that are named, or what is due, asked again and again: a fall may spare what would follow."""
        if self._asked.episode:
            yield from (episode for episode in self._request["episodes"] if episode["name"] in self._asked.episode)
            return
        while missing := self._due():
            yield missing[0]

    def _due(self) -> list[Mapping[str, Any]]:
        episodes = self._request["episodes"]
        ends = {episodes[number]["name"]: down for number, down in journal.ends(self._asked.log).items()}
        fallen = {name for name, row in journal.read_returns(self._returns).items() if _fell(row)}
        return list(due(self._request, {*ends, *fallen}, {name for name, down in ends.items() if down} | fallen))

    def _ask(self, question: str) -> bool:
        return self._asked.yes or _read_line(f"{question}: ") != "q"

    def _yes(self, question: str) -> bool:
        return _read_line(f"{question}: ") in ("y", "yes")

    def _seconds(self, episode: Mapping[str, Any]) -> float:
        return float(episode["steps"] * self._request["control_period"])


def _read_line(question: str) -> str:
    try:
        return input(question).strip().lower()
    except (EOFError, OSError, RuntimeError, ValueError) as error:  # stdin is closed, or no text comes from it
        raise NobodyToAsk("there is nobody to ask; --yes asks nothing") from error


def _both(first: BaseException | None, left: str) -> BaseException:
    """Return the first fault, and where the robot was left, as one."""
    if first is None:
        return RobotError(left)
    if not left:
        return first
    if isinstance(first, KeyboardInterrupt):
        return KeyboardInterrupt(left)
    return RobotError(f"{first}; {left}") if isinstance(first, GslError | OSError) else first


def _fell(row: Mapping[str, str]) -> bool:
    return journal.is_yes(row.get("fell"))


def _is_distance(text: str) -> bool:
    try:
        return text in ("", "f") or abs(float(text)) < MOST
    except ValueError:
        return False
