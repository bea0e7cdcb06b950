"""Budgets: what a file may take to be read, in bytes, depth, entries and time; every reader of files asks here.

The limits are far above what gsl or a log of a robot needs, and far below what fills a computer.
"""

from __future__ import annotations

import errno
import json
import math
import os
import signal
import stat
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from gsl.errors import InputError

TEXT_BYTES = 1_000_000
"""Of a yaml file; the largest of ours has 20,000."""
DOCUMENT_BYTES = 200_000_000
"""Of a JSON document in an artifact."""
MANIFEST_BYTES = 20_000_000
"""Of a manifest, which names each file in a hundred."""
ARTIFACT_BYTES = 16_000_000_000
"""Of one file in an artifact: what a trajectory file may take in memory (gsl/storage/parquet.py)."""
NETWORK_BYTES = 2_000_000_000
"""Of the file of a policy that was trained elsewhere, and of what it unpacks to."""
DIGITS = 300
"""Of a whole number, so that it is also one of floating point."""
DEPTH = 64
"""Of what is nested; the deepest of ours has 12 levels."""
ENTRIES = 100_000
"""Of a yaml file with its aliases written out."""
SETTINGS = 20_000
"""Entries of a yaml file that is put together with others, which takes a millisecond each."""
COLUMNS = 10_000
"""Of a log; a humanoid with all its sensors has some hundred."""
HEADER_BYTES = 10_000
"""Of the header of a numpy array; numpy's own limit, which it looks at too late."""
URDF_BYTES = 20_000_000
JOINTS = 500
"""Of a URDF; a humanoid with both hands has about 80."""
MESH_BYTES = 100_000_000
"""Of a mesh: two million triangles."""
SECONDS = 10.0
"""Of CPU for a file or a configuration that should take less than one."""
GROWTH = 1_500_000_000
"""Bytes by which the process may grow meanwhile."""
_KERNEL = ("/proc/", "/sys/")  # folders of files that the kernel makes up
_TICK = 0.05  # of CPU between two looks at what was taken [s]


def check_file(path: Path, most: float = math.inf) -> None:
    """Refuse what is no plain file, or larger than allowed [bytes].

    A device or a pipe may never end, and so may a file of the kernel, such as /proc/kmsg, though it is called plain.

    Raises:
        InputError: It says which.
        OSError: There is no such file, it is a folder, or it cannot be looked at.
    """
    about = path.stat()
    if stat.S_ISDIR(about.st_mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder", str(path))
    if not stat.S_ISREG(about.st_mode) or about.st_dev in _kernels() or os.path.realpath(path).startswith(_KERNEL):
        raise InputError(f"{path}: is no plain file")
    if about.st_size > most:
        raise InputError(f"{path}: has {about.st_size:,} bytes; {most:,.0f} are read at most")


@cache
def _kernels() -> frozenset[int]:
    """Return the devices of the kernel's file systems, which can be mounted elsewhere as well."""
    return frozenset(os.stat(place).st_dev for place in _KERNEL if os.path.ismount(place))


def is_plain(path: Path) -> bool:
    """Whether there is a file that can be read to its end."""
    try:
        check_file(path)
    except (OSError, InputError):
        return False
    return True


def read_text(path: Path, most: float = TEXT_BYTES) -> str:
    """Return the text of a small file.

    Raises:
        InputError: It cannot be read, is too large, or is no text in UTF-8.
    """
    try:
        check_file(path, most)
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is no text in UTF-8 (byte {error.start}); save it as UTF-8") from error


def parse_json(text: str | bytes) -> Any:
    """Return what a JSON text says.

    Raises:
        ValueError: It is no JSON, not UTF-8, nested too deeply, or holds a number of too many digits.
    """
    try:
        return json.loads(text, parse_int=_whole)
    except RecursionError as error:
        raise ValueError("is nested too deeply") from error


def _whole(digits: str) -> int:
    if len(digits) > DIGITS:
        raise ValueError(f"holds a number of {len(digits):,} digits")
    return int(digits)


def read_json(path: Path, most: float = DOCUMENT_BYTES) -> Any:
    """Return what a document of an artifact says; `most` is how many bytes it may have.

    Raises:
        OSError: There is no such file, or it cannot be read.
        ValueError: It is no JSON, or damaged.
        InputError: It is no plain file, or too large.
    """
    check_file(path, most)
    return parse_json(path.read_text(encoding="utf-8"))


@contextmanager
def within(what: str, seconds: float = SECONDS, growth: float = GROWTH) -> Iterator[None]:
    """Within, end whatever takes too much CPU or memory: a hostile pattern, references that multiply.

    In the main thread alone, and where the system has such a timer; elsewhere the other limits have to do.

    Args:
        what: Is done, for the error.
        seconds: Of CPU.
        growth: Of the process [bytes].

    Raises:
        InputError: It took more.
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return
    if signal.getitimer(signal.ITIMER_PROF)[0]:  # within another budget
        yield
        return
    begin, before = time.process_time(), _resident()

    def look(number: int, frame: object) -> None:
        if time.process_time() - begin > seconds:
            raise InputError(f"{what} takes more than {seconds:g} s of CPU; it is given up")
        if _resident() - before > growth:
            raise InputError(f"{what} takes more than {growth / 1e9:g} GB of memory; it is given up")

    old = signal.signal(signal.SIGPROF, look)
    signal.setitimer(signal.ITIMER_PROF, _TICK, _TICK)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, old)


def _resident() -> float:
    """Return the memory of this process [bytes]; 0 where the system does not say."""
    try:
        return float(Path("/proc/self/statm").read_text().split()[1]) * 4096.0
    except (OSError, IndexError, ValueError):
        return 0.0


def find_repeat(names: Iterable[str]) -> str | None:
    """Return the first name that comes twice, None if none does."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None
