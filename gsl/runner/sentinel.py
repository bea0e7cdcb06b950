"""Ends a runner in which a function hangs that never gives the interpreter back: nothing else in there can act then.

A program of its own, which the runner starts. What is under way stands in memory that both share; so a control loop
pays nothing for it. It ends with the runner, which holds the other end of its input.
"""

from __future__ import annotations

import mmap
import os
import select
import signal
import struct
import sys
import time

UNDER_WAY = struct.Struct("<dd32s")  # by when it has to be over, 0 for nothing; how long that is [s]; its name
LOOK = 0.2  # between two looks [s]


def watch(runner: int, shared: mmap.mmap) -> None:
    """Watch over a process until it ends, or end it."""
    while os.getppid() == runner and not select.select([0], [], [], LOOK)[0]:
        deadline, seconds, name = UNDER_WAY.unpack_from(shared)
        if not 0.0 < deadline < time.monotonic():
            continue
        problem = f"{name.rstrip(bytes(1)).decode()}() has not returned for {seconds:g} s and lets nothing else act"
        sys.stdout.write(f"runner.py: {problem}; the runner is ended, the robot is left at its last target\n")
        sys.stdout.flush()
        os.kill(runner, signal.SIGKILL)
        return


if __name__ == "__main__":
    watch(int(sys.argv[1]), mmap.mmap(int(sys.argv[2]), UNDER_WAY.size))
