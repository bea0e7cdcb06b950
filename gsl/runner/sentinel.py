"""Ends a runner in which a function hangs that never gives the interpreter back: nothing else in there can act then.

A program of its own, which the runner starts. Its input says what is called and how long that may take, then that it
is over; at the end of its input it ends.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import time

LOOK = 1.0  # between two looks for whether the runner is still there [s]


def watch(runner: int) -> None:
    """Watch over a process until it ends, or end it."""
    name, seconds, deadline, text = "", "", float("inf"), b""
    while os.getppid() == runner:
        ready, _, _ = select.select([0], [], [], max(0.0, min(LOOK, deadline - time.monotonic())))
        if ready:
            new = os.read(0, 1 << 16)
            if not new:
                return
            *lines, text = (text + new).split(b"\n")
            if lines:
                name, _, seconds = lines[-1].decode().rpartition(" ")
                deadline = time.monotonic() + float(seconds) if seconds else float("inf")
        elif time.monotonic() >= deadline:
            problem = f"{name}() has not returned for {float(seconds):g} s and lets nothing else act"
            sys.stdout.write(f"runner.py: {problem}; the runner is ended, the robot is left at its last target\n")
            sys.stdout.flush()
            os.kill(runner, signal.SIGKILL)
            return


if __name__ == "__main__":
    watch(int(sys.argv[1]))
