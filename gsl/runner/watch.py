"""The watch over what a runner calls: a function that never returns is named and given up, and the robot brought back.

Parts of a sitting run in a thread beside the one that waits for them. So the waiting thread hears Ctrl-C whatever a
function does with it, and can send when reading hangs. Within a part functions are called directly: a control loop has
no time for more.
"""

from __future__ import annotations

import mmap
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from queue import SimpleQueue
from typing import Any

from gsl.runner import sentinel
from gsl.runner.senses import RobotError
from gsl.runner.sentinel import UNDER_WAY

LIMIT = 2.0  # of one call [s]: a hundred control periods; a tick later than three ends an episode anyway
FIRST = 5.0  # times the limit may a call take that opens a connection or waits for the robot to stand
TIME_LIMIT = "TIME_LIMIT"  # by which name a robot's file says another limit [s]
SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")  # that ask the runner to end
LOOK = 0.1  # between two looks at what is under way [s]


class Hangs(RobotError):
    """A function does not return; `name` says which."""

    def __init__(self, name: str, seconds: float) -> None:
        super().__init__(f"{name}() has not returned for {seconds:g} s")
        self.name = name


class GivenUp(BaseException):
    """Ends a thread that was given up, in case what hung in it returns after all."""


class _Part:
    """A part of a sitting, under way or done."""

    def __init__(self, function: Callable[..., Any], words: tuple[Any, ...]) -> None:
        self._function, self._words, self.done = function, words, threading.Event()
        self._value: Any = None
        self._error: BaseException | None = None

    def run(self) -> None:
        """Do it."""
        try:
            self._value = self._function(*self._words)
        except BaseException as error:  # whatever it is, it is for the thread that waits
            self._error = error

    def result(self) -> Any:
        """Return what came of it, or raise what it raised."""
        if self._error is not None:
            raise self._error
        return self._value


class _Worker(threading.Thread):
    """A thread that waits for parts; a daemon, so that one that hangs does not keep the process."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.parts: SimpleQueue[_Part] = SimpleQueue()
        self.is_busy = self.is_given_up = False
        self.start()

    def run(self) -> None:
        """Do one part after another."""
        while not self.is_given_up:
            part = self.parts.get()
            self.is_busy = True
            part.run()
            self.is_busy = False
            part.done.set()


def is_stuck() -> bool:
    """Whether a function is still under way somewhere, so that the process might not end by itself."""
    return any(isinstance(thread, _Worker) and thread.is_busy for thread in threading.enumerate())


class Watch:
    """Runs parts of a sitting, and gives up one in which a call takes too long.

    Args:
        limit: Of one call [s].
    """

    def __init__(self, limit: float = LIMIT) -> None:
        self.hung: set[str] = set()
        self._limit, self._interrupted, self._lock = limit, False, threading.Lock()
        self._worker: _Worker | None = None
        self._sentinel: mmap.mmap | None = None
        self._under_way: tuple[str, float, float] | None = None  # what is called, how long it may take, until when [s]

    def run(self, function: Callable[..., Any], *words: Any) -> Any:
        """Return what a part returns, or raise what it raises; Ctrl-C breaks it off after the call under way.

        Raises:
            Hangs: A call in it does not return.
            KeyboardInterrupt: Ctrl-C; if the call under way does not return, `hung` says which.
        """
        if self._worker is None:
            self._worker, self._sentinel = _Worker(), _sentinel()
        part = _Part(function, words)
        with self._hearing():
            self._worker.parts.put(part)
            while not part.done.wait(min(LOOK, 0.25 * self._limit)):
                self._look()
        value = part.result()
        self._check_interrupted()
        return value

    def call(self, name: str, function: Callable[..., Any], *words: Any, patience: float = 1.0) -> Any:
        """Return what a function returns, or raise what it raises, while the thread that waits looks at the time.

        Args:
            name: What it is called in a message.
            function: The function.
            words: Its arguments.
            patience: How many times longer than usual it may take.
        """
        seconds = patience * self._limit
        self._note((name, seconds, time.monotonic() + seconds))
        try:
            return function(*words)
        finally:
            self._note(None)
            self._check_interrupted()

    def _note(self, call: tuple[str, float, float] | None) -> None:
        """Note what is under way; a thread that was given up ends here."""
        thread = threading.current_thread()
        with self._lock:
            if isinstance(thread, _Worker) and thread.is_given_up:
                raise GivenUp
            self._under_way = call
            self._tell_sentinel()

    def _look(self) -> None:
        """Give up what has been under way for too long."""
        with self._lock:
            if (call := self._under_way) is None or time.monotonic() < call[2]:
                return
            assert self._worker is not None
            self._worker.is_given_up, self._worker, self._under_way = True, _Worker(), None
            self._tell_sentinel()
        self.hung.add(call[0])
        hangs = Hangs(call[0], call[1])
        if self._interrupted:
            self._interrupted = False
            raise KeyboardInterrupt from hangs
        raise hangs

    @contextmanager
    def _hearing(self) -> Iterator[None]:
        """Note Ctrl-C and other signals to end, while a part runs, instead of raising them in the thread that waits."""
        numbers = [getattr(signal, name) for name in SIGNALS if hasattr(signal, name)]
        before = {number: signal.signal(number, self._interrupt) for number in numbers}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _interrupt(self, number: int, frame: object) -> None:
        self._interrupted = True

    def _check_interrupted(self) -> None:
        if self._interrupted:
            self._interrupted = False
            raise KeyboardInterrupt

    def _tell_sentinel(self) -> None:
        """Say what is under way and how long it may take: if nobody has acted by then, it holds the interpreter."""
        if self._sentinel is not None:
            name, seconds, deadline = self._under_way or ("", 0.0, 0.0)
            UNDER_WAY.pack_into(self._sentinel, 0, deadline + seconds, 2.0 * seconds, name.encode())


def limit_of(robot: Any) -> float:
    """Return how long a call of a robot's functions may take [s].

    Raises:
        RobotError: Its file says what is no time.
    """
    limit = getattr(robot, TIME_LIMIT, LIMIT)
    if isinstance(limit, bool) or not isinstance(limit, int | float) or not 0.0 < limit < float("inf"):
        raise RobotError(f"{TIME_LIMIT} of the robot's file is {limit!r}, not a positive number of seconds")
    return float(limit)


def _sentinel() -> mmap.mmap | None:
    """Start the process beside this one and return the memory that it shares; there is none on Windows."""
    if os.name == "nt":
        return None
    with tempfile.TemporaryFile() as file:
        file.truncate(UNDER_WAY.size)
        shared = mmap.mmap(file.fileno(), UNDER_WAY.size)
        words = [sys.executable, "-I", "-S", str(sentinel.__file__), str(os.getpid()), str(file.fileno())]
        process = subprocess.Popen(words, stdin=subprocess.PIPE, start_new_session=True, pass_fds=(file.fileno(),))
    assert process.stdin is not None
    os.dup(process.stdin.fileno())  # stays open as long as we are there
    process.stdin.close()
    process.returncode = 0  # it ends after us; nobody waits for it
    return shared
