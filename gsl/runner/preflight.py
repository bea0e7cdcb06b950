"""What is looked at before anything moves: whether the answer can be written, is whole, and nobody else runs."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gsl.errors import ArtifactError, GslError
from gsl.runner import journal

LOCK = ".runner.lock"
_YES_NO = ("fell", "stopped")


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Hold the lock of a request's folder; that of a process that has ended is free, since the system frees it.

    Raises:
        GslError: Another runner has it.
    """
    try:
        import fcntl
    except ImportError:  # not on Windows
        yield
        return
    with (folder / LOCK).open("a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            file.seek(0)
            raise GslError(f"another runner (process {file.read().strip()}) is at work here; end it first") from error
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        try:
            yield
        finally:  # a process that the robot's file has forked has the file open as well, and may outlive this one
            fcntl.flock(file, fcntl.LOCK_UN)


def check_writable(log: Path) -> None:
    """Refuse a log that could not be written after an episode.

    Raises:
        ArtifactError: Its folder is missing or cannot be written, or it is no file.
    """
    if not log.parent.is_dir():
        raise ArtifactError(log.parent, "there is no such folder; make it, or choose another --log")
    if log.exists() and not log.is_file():
        raise ArtifactError(log, "is no file; choose another --log")
    trial = log.with_name(f".{log.name}.tmp")
    try:
        with trial.open("w", encoding="utf-8"):
            pass
        trial.unlink()
    except OSError as error:
        raise ArtifactError(log.parent, f"cannot be written ({error.strerror}); choose another --log") from error


def mend(log: Path, request: Mapping[str, Any]) -> str:
    """Check an answer to the end, drop a last episode that was cut off from it, and return what was done, if anything.

    Raises:
        ArtifactError: It cannot be gone on with.
    """
    if not log.exists():
        return ""
    text = log.read_text(encoding="utf-8", errors="replace")
    lines = text.splitlines()
    names = lines[1].split(",") if len(lines) > 1 else []
    if not names:
        raise ArtifactError(log, "holds no more than which request it answers; remove it")
    for name in ("episode", "step", "time", *(f"action.{joint}" for joint in request["joints"]), *_YES_NO):
        if name not in names:
            raise ArtifactError(log, f"has no column {name}; move it away, or choose another --log")
    rows = [line.split(",") for line in lines[2:]]
    whole = len(rows)
    if rows and (len(rows[-1]) < len(names) or rows[-1][-1] not in ("true", "false")):
        whole -= 1
    whole = _complete(log, request, names, rows[:whole])
    if whole < len(rows) or not text.endswith("\n"):
        journal.replace(log, "".join(f"{line}\n" for line in lines[: 2 + whole]))
    return "" if whole == len(rows) else f"{log}: its last episode was cut off; it is dropped, to be run again"


def _complete(log: Path, request: Mapping[str, Any], names: Sequence[str], rows: Sequence[Sequence[str]]) -> int:
    """Return how many rows there are up to the end of the last episode that has one."""
    episodes, done, now, whole = request["episodes"], set[int](), None, 0
    for at, cells in enumerate(rows):
        if len(cells) != len(names):
            raise _damage(log, at, "has another number of cells than there are columns")
        row = dict(zip(names, cells, strict=True))
        _check_cells(log, at, row)
        text = row["episode"]
        if not text.isdecimal() or int(text) >= len(episodes):
            raise _damage(log, at, f"there is no episode '{text[:20]}', only 0 to {len(episodes) - 1}")
        number = int(text)
        if number in done or now not in (None, number):
            name = episodes[number if number in done else now]["name"]
            raise _damage(log, at, f"{name} {'is there twice' if number in done else 'has no last row'}")
        now = number
        if not row[f"action.{request['joints'][0]}"]:  # nothing was sent any more
            done.add(number)
            now, whole = None, at + 1
    return whole


def _check_cells(log: Path, at: int, row: Mapping[str, str]) -> None:
    for name, cell in row.items():
        if name in _YES_NO:
            if cell.lower() not in ("true", "false"):
                raise _damage(log, at, f"{name} is '{cell[:20]}', not true or false")
        elif name != "episode" and cell and not _is_finite(cell):
            raise _damage(log, at, f"{name} is '{cell[:20]}', not a number")


def _is_finite(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _damage(log: Path, at: int, problem: str) -> ArtifactError:
    return ArtifactError(log, f"line {at + 3}: {problem}; remove the rows of that episode, or choose another --log")
