"""The process of the runner, whose end nothing that a robot's file has started puts off."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from gsl.runner.main import main
from gsl.runner.saying import say

PATIENCE = 2.0  # with what keeps the process after its end [s], as with a call of the robot


def run(folder: Path, words: Sequence[str]) -> None:
    """Run the command line of the runner in a request's folder and end this process with its exit code.

    By then all is written and sent; a thread or process that the robot's file has started does not keep it.
    """
    code = main(folder, words)
    threading.Thread(target=_end_late, args=(code,), daemon=True).start()
    sys.exit(code)


def _end_late(code: int) -> None:
    """Wait for what Python itself waits for at its end, such as threads, but not forever."""
    time.sleep(PATIENCE)
    others = (thread for thread in threading.enumerate() if not thread.daemon and thread is not threading.main_thread())
    left = ", ".join(thread.name for thread in others) or "something"
    say(f"runner.py: {left} of the robot's file was still at work {PATIENCE:g} s after the end; it is ended")
    os._exit(code)
