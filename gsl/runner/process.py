"""The process of the runner, whose end nothing that a robot's file has started puts off."""

from __future__ import annotations

import faulthandler
import os
import signal
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gsl.runner.main import main
from gsl.runner.saying import say
from gsl.runner.watch import SIGNALS, is_stuck

PATIENCE = 2.0  # with what keeps the process after its end [s], as with a call of the robot


def run(folder: Path, words: Sequence[str]) -> None:
    """Run the command line of the runner in a request's folder and end this process with its exit code.

    By then all is written and sent; a thread or process that the robot's file has started does not keep it.
    """
    code = 1  # that of Python for what is raised
    try:
        code = main(folder, words)
    finally:
        for name in SIGNALS:  # there is nothing left to break off
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), signal.SIG_IGN)
        if is_stuck():  # what hangs may keep the process from its end as well
            _end(code)
        threading.Thread(target=_end_late, args=(code,), daemon=True).start()
        # where Python takes itself apart no thread runs any more, but a __del__ of the robot's file may hang
        faulthandler.dump_traceback_later(2.0 * PATIENCE, exit=True, file=open(os.devnull, "w"))  # noqa: SIM115
    sys.exit(code)


def _end_late(code: int) -> None:
    """Wait for what Python itself waits for at its end, such as threads, but not forever."""
    time.sleep(PATIENCE)
    try:
        others = [thread for thread in threading.enumerate() if thread is not threading.main_thread()]
        left = [each.name for each in (*others, *_list_children()) if not each.daemon]
        names = ", ".join(left) or "something"
        say(f"runner.py: {names} of the robot's file was still at work {PATIENCE:g} s after the end; it is ended")
    finally:
        _end(code)


def _end(code: int) -> None:
    """End this process and those that the robot's file has started by multiprocessing, which might drive it on."""
    try:
        for child in _list_children():
            child.kill()
            child.join(PATIENCE)  # it drives nothing any more by the time that this process has ended
    finally:
        os._exit(code)


def _list_children() -> Sequence[Any]:
    """Return the processes that are still alive; a robot's computer may lack what multiprocessing needs."""
    return sys.modules["multiprocessing"].active_children() if "multiprocessing" in sys.modules else ()
