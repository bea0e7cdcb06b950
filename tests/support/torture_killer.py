"""gsl that is killed before its n-th write below the current folder: python torture_killer.py N FILE ARGUMENTS...

With n = 0 it is not, and the file says how many there were.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
from pathlib import Path
from typing import Any

CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate", "os.utime", "shutil.rmtree")
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


class Killer:
    """Counts what changes files, and kills this process before one of these events."""

    def __init__(self, last: int) -> None:
        self.last, self.count, self.whose, self.here = last, 0, os.getpid(), os.getcwd() + os.sep

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event != "open" and event not in CHANGES:
            return
        path = arguments[0]
        if not isinstance(path, str | os.PathLike) or (event == "open" and not (arguments[2] or 0) & WRITING):
            return
        place = os.fspath(path)
        if os.getpid() != self.whose or (os.path.isabs(place) and not str(place).startswith(self.here)):
            return
        self.count += 1
        if self.count == self.last:
            os.kill(self.whose, signal.SIGKILL)


if __name__ == "__main__":
    killer, file = Killer(int(sys.argv[1])), Path(sys.argv[2])
    sys.argv = ["gsl", *sys.argv[3:]]
    del sys.path[0]  # a file beside this one is no module of gsl's
    from gsl.cli import main

    atexit.register(lambda: file.write_text(str(killer.count)))
    sys.addaudithook(killer)
    main()
