"""An interruption is Ctrl-C or SIGTERM; one that some library swallowed is raised again at the next checkpoint."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

ECHO = 2.0  # seconds in which the same wish may arrive again, as from `timeout`, which tells the process and its group

_asked = _held = False
_heard = -ECHO


def listen() -> None:
    """Let SIGTERM, and SIGINT in a background job, end this process as Ctrl-C does, so that it can tidy up."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, _interrupt)


def ignore() -> None:
    """Let nothing disturb the end of this process, which is near."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)


def is_interrupted() -> bool:
    """Whether this process was interrupted."""
    return _asked


def checkpoint() -> None:
    """Raise KeyboardInterrupt if this process was interrupted and is still running."""
    if _asked:
        raise KeyboardInterrupt


@contextmanager
def hold_interrupts() -> Iterator[None]:
    """Let an interruption wait for the end of the block: one in the middle of an import of torch aborts the process."""
    global _held
    before, _held = _held, True
    try:
        yield
    finally:
        _held = before
    if not _held:
        checkpoint()


@contextmanager
def processes_starting() -> Iterator[None]:
    """Let processes that start in the block leave Ctrl-C to this one, which hears it afterwards and ends them."""
    from multiprocessing import resource_tracker

    from joblib.externals.loky.backend import resource_tracker as loky_resource_tracker

    # Both would let Ctrl-C through again when they start in the block. They tidy up what an interruption leaves and do
    # not warn of it: a thread may have been stopped just before it said that its semaphore is gone already.
    sys.warnoptions.append("ignore:resource_tracker")
    try:
        resource_tracker.ensure_running()
        loky_resource_tracker.ensure_running()
    finally:
        sys.warnoptions.remove("ignore:resource_tracker")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@cache
def end_with_parent(parent: int) -> None:
    """Let this process end soon after the one that started it, which cannot see to it after a kill -9."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _interrupt(number: int, frame: Any) -> None:
    global _asked, _heard
    if time.monotonic() - _heard < ECHO:
        return
    _asked, _heard = True, time.monotonic()
    if not _held:
        raise KeyboardInterrupt
