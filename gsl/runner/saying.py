"""What a runner tells a person: a terminal that is gone, or cannot show a letter, keeps no robot from its way back."""

from __future__ import annotations

import os
import sys

from gsl.core.visible import visible


def say(text: str) -> None:
    """Tell a person something; nobody, if stdout is gone, or closed by a robot's file."""
    if sys.stdout is None or sys.stdout.closed:
        return
    encoding = sys.stdout.encoding or "utf-8"
    shown = visible(text).encode(encoding, "backslashreplace").decode(encoding)
    try:
        sys.stdout.write(f"{shown}\n")
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python would try it again at its end
