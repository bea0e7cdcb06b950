"""An interruption is Ctrl-C or SIGTERM; one that some library swallowed is raised again at the next checkpoint."""

from __future__ import annotations

import signal
from typing import Any

_asked = False


def listen() -> None:
    """Let SIGTERM, and SIGINT in a background job, end this process as Ctrl-C does, so that it can tidy up."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, _interrupt)


def asked() -> bool:
    """Whether this process was interrupted."""
    return _asked


def checkpoint() -> None:
    """Raise KeyboardInterrupt if this process was interrupted and is still running."""
    if _asked:
        raise KeyboardInterrupt


def _interrupt(number: int, frame: Any) -> None:
    global _asked
    _asked = True
    raise KeyboardInterrupt
