"""The watch over what a runner calls: a function that never returns is given up, named, and gone on without.

Functions are called one after another in a thread beside the one that waits for them. So the waiting thread hears
Ctrl-C at once, whatever the function does with it, and can still send when reading hangs.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from queue import SimpleQueue
from typing import Any

from gsl.runner import sentinel
from gsl.runner.senses import RobotError

LIMIT = 2.0  # of one call [s]: a hundred control periods; a tick later than three ends an episode anyway
FIRST = 5.0  # times the limit may a call take that opens a connection or waits for the robot to stand
TIME_LIMIT = "TIME_LIMIT"  # by which name a robot's file says another limit [s]


class Hangs(RobotError):
    """A function does not return; `name` says which."""

    def __init__(self, name: str, seconds: float) -> None:
        super().__init__(f"{name}() has not returned for {seconds:g} s")
        self.name = name


class _Call:
    """One call of a function, under way or done."""

    def __init__(self, name: str, function: Callable[..., Any], words: tuple[Any, ...]) -> None:
        self.name, self._function, self._words = name, function, words
        self.done = threading.Event()
        self._value: Any = None
        self._error: BaseException | None = None

    def run(self) -> None:
        """Call it."""
        try:
            self._value = self._function(*self._words)
        except BaseException as error:  # whatever it is, it is for the thread that waits
            self._error = error

    def result(self) -> Any:
        """Return what it returned, or raise what it raised."""
        if self._error is not None:
            raise self._error
        return self._value


class _Worker(threading.Thread):
    """A thread that waits for calls; a daemon, so that one that hangs does not keep the process."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.calls: SimpleQueue[_Call] = SimpleQueue()
        self.is_busy = False
        self.start()

    def run(self) -> None:
        """Call one function after another."""
        while True:
            call = self.calls.get()
            self.is_busy = True
            call.run()
            self.is_busy = False
            call.done.set()


def is_stuck() -> bool:
    """Whether a function is still under way somewhere, so that the process might not end by itself."""
    return any(isinstance(thread, _Worker) and thread.is_busy for thread in threading.enumerate())


class Watch:
    """Calls functions, each within a limit of time.

    Args:
        limit: Of one call [s].
        guarded: Whether a process beside this one ends it if a function never gives the interpreter back.
    """

    def __init__(self, limit: float = LIMIT, *, guarded: bool = False) -> None:
        self.hung: set[str] = set()
        self._limit, self._worker = limit, _Worker()
        self._last: _Call | None = None
        self._sentinel = _sentinel() if guarded else None

    def call(self, name: str, function: Callable[..., Any], *words: Any, patience: float = 1.0) -> Any:
        """Return what a function returns, or raise what it raises.

        Args:
            name: What it is called in a message.
            function: The function.
            words: Its arguments.
            patience: How many times longer than usual it may take.

        Raises:
            Hangs: It does not return, or one before it, from which Ctrl-C called us away, has not returned yet.
        """
        if self._last is not None:
            self._wait(self._last, 1.0)
        self._last = call = _Call(name, function, words)
        self._worker.calls.put(call)
        self._wait(call, patience)
        return call.result()

    def _wait(self, call: _Call, patience: float) -> None:
        seconds = patience * self._limit
        self._tell(f"{call.name} {2.0 * seconds}\n")  # if nobody acts in time, it holds the interpreter
        try:
            returned = call.done.wait(seconds)
        finally:
            self._tell("\n")
        self._last = None
        if not returned:
            self.hung.add(call.name)
            self._worker = _Worker()
            raise Hangs(call.name, seconds)

    def _tell(self, line: str) -> None:
        if self._sentinel is not None:
            with suppress(OSError):  # a sentinel that is gone or stuck must not stop the robot
                os.write(self._sentinel, line.encode())


def limit_of(robot: Any) -> float:
    """Return how long a call of a robot's functions may take [s].

    Raises:
        RobotError: Its file says what is no time.
    """
    limit = getattr(robot, TIME_LIMIT, LIMIT)
    if isinstance(limit, bool) or not isinstance(limit, int | float) or not 0.0 < limit < float("inf"):
        raise RobotError(f"{TIME_LIMIT} of the robot's file is {limit!r}, not a positive number of seconds")
    return float(limit)


def _sentinel() -> int | None:
    """Start the process beside this one and return the pipe to it; there is none on Windows."""
    if os.name == "nt":
        return None
    words = [sys.executable, "-I", "-S", str(sentinel.__file__), str(os.getpid())]
    process = subprocess.Popen(words, stdin=subprocess.PIPE, start_new_session=True)
    assert process.stdin is not None
    number = os.dup(process.stdin.fileno())
    process.stdin.close()
    process.returncode = 0  # it ends after us; nobody waits for it
    os.set_blocking(number, False)
    return number
