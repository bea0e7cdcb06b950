"""An interruption is Ctrl-C or SIGTERM; one that some library swallowed is raised again at the next checkpoint."""

from __future__ import annotations

import signal
import time
from typing import Any

ECHO = 2.0  # seconds in which the same wish may arrive again, as from `timeout`, which tells the process and its group

_asked = False
_heard = -ECHO


def listen() -> None:
    """Let SIGTERM, and SIGINT in a background job, end this process as Ctrl-C does, so that it can tidy up."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, _interrupt)


def ignore() -> None:
    """Let nothing disturb the end of this process, which is near."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)


def asked() -> bool:
    """Whether this process was interrupted."""
    return _asked


def checkpoint() -> None:
    """Raise KeyboardInterrupt if this process was interrupted and is still running."""
    if _asked:
        raise KeyboardInterrupt


def _interrupt(number: int, frame: Any) -> None:
    global _asked, _heard
    if time.monotonic() - _heard < ECHO:
        return
    _asked, _heard = True, time.monotonic()
    raise KeyboardInterrupt
