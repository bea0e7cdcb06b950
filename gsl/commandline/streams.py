"""The standard streams of a process: open, whoever has closed them, and fit for any text."""

from __future__ import annotations

import io
import os
import sys


def prepare_streams() -> None:
    """Open what is closed on nothing, and let what a terminal cannot show be spelled out.

    A file that is opened later would otherwise take the place of a closed stream, and get what is printed.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free, which is this one
    sys.stdout, sys.stderr = (stream or _nowhere(number) for number, stream in ((1, sys.stdout), (2, sys.stderr)))
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _nowhere(number: int) -> io.TextIOWrapper:
    return open(number, "w", encoding="utf-8", closefd=False)
