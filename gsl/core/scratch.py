"""A temporary folder of this process, for files that a library wants to read; those of killed processes go."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

_NAME = re.compile(r"gsl-(\d+)-(\d+)-.+")


class Scratch(TemporaryDirectory[str]):
    """A folder below the system's temporary one, named after this process, that goes with it."""

    def __init__(self) -> None:
        _sweep()
        super().__init__(prefix=f"gsl-{_namespace()}-{os.getpid()}-")


@cache
def _sweep() -> None:
    """Remove, once a process, our folders of processes that are gone."""
    for path in Path(tempfile.gettempdir()).glob("gsl-*"):
        name = _NAME.fullmatch(path.name)
        if name and int(name[1]) == _namespace() != 0 and not Path(f"/proc/{name[2]}").exists():
            shutil.rmtree(path, ignore_errors=True)  # what is somebody else's stays


@cache
def _namespace() -> int:
    """Return what tells the processes of a container from those of another that shares its folder, 0 if unknown."""
    try:
        return os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        return 0
