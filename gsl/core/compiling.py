"""Whether numba compiles right now, which the first command after an installation waits for, a minute or two."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from gsl.core.scratch import Scratch

_running = 0
_mark: Path | None = None  # of this process, if it is a worker: there while it compiles
_marks: Scratch | None = None  # of the workers of this process


def is_compiling() -> bool:
    """Whether a function is being compiled, here or in a worker; loading one from the cache on disk does not count."""
    return _running > 0 or any(map(_is_alive, _list_marks()))


def count_compilation(change: int) -> None:
    """Note that a compilation begins (1) or ends (-1); numba lets one thread compile at a time."""
    global _running
    _running += change
    if _mark is not None:
        with suppress(OSError):  # the process that looks at it may be gone
            _mark.touch() if _running else _mark.unlink(missing_ok=True)


def share_compilations() -> str:
    """Return the folder in which workers of this process say that they compile; they are told of it by `report_to`."""
    global _marks
    _marks = _marks or Scratch()
    return _marks.name


def report_to(folder: str) -> None:
    """Let another process see in a folder of its own when this one compiles."""
    global _mark
    _mark = Path(folder, str(os.getpid()))


def _list_marks() -> list[str]:
    try:
        return os.listdir(_marks.name) if _marks else []
    except FileNotFoundError:  # somebody has tidied up the system's temporary folder
        return []


def _is_alive(process: str) -> bool:
    try:
        os.kill(int(process), 0)
    except OSError:  # it was killed while it compiled, and its number may be another user's by now
        return False
    return True
