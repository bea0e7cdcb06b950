"""Budgets: what a file may take to be read, in bytes, depth, entries and time; every reader of files asks here.

The limits are far above what gsl or a log of a robot needs, and far below what fills a computer.
"""

from __future__ import annotations

import errno
import io
import json
import math
import os
import signal
import stat
import sys
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
MOVING = 120
"""Joints of a URDF that turn or slide: Bullet ends the process with 128, those of the base included."""
MESH_BYTES = 100_000_000
"""Of a mesh: two million triangles."""
SECONDS = 10.0
"""Of CPU for a file or a configuration that should take less than one."""
GROWTH = 1_500_000_000
"""Bytes by which the process may grow meanwhile."""
_KERNEL = ("/proc/", "/sys/")  # folders of files that the kernel makes up
_KERNEL_TYPES = frozenset(  # of their file systems, which can be mounted elsewhere as well
    ("proc", "sysfs", "cgroup", "cgroup2", "debugfs", "tracefs", "securityfs", "configfs", "pstore", "bpf", "efivarfs")
    + ("binfmt_misc", "fusectl", "nsfs", "selinuxfs", "smackfs", "resctrl", "nfsd", "rpc_pipefs", "functionfs")
)
_NOT_PLAIN = "is no plain file; copy what it holds into one"
_TICK = 0.05  # of CPU between two looks at what was taken [s]


def check_file(path: Path, most: float = math.inf) -> None:
    """Refuse what is no plain file, or larger than allowed [bytes]; readers of ours call `open_file`.

    A device or a pipe may never end, and so may a file of the kernel, such as /proc/kmsg, though it is called plain.
    Libraries that open a path themselves (h5py, safetensors, rosbags, torch) may find another file there by then.
    Its identity is not compared, for hashes are: a stage hashes what it reads before and after its work.

    Raises:
        InputError: It says which.
        OSError: There is no such file, it is a folder, or it cannot be looked at.
    """
    _check(path, path.stat(), most)
    if os.path.realpath(path).startswith(_KERNEL):  # may lead to a device that is mounted for another process alone
        raise InputError(f"{path}: {_NOT_PLAIN}")


def _check(path: Path, about: os.stat_result, most: float) -> None:
    if stat.S_ISDIR(about.st_mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder", str(path))
    if not stat.S_ISREG(about.st_mode) or _is_kernels(about.st_dev):
        raise InputError(f"{path}: {_NOT_PLAIN}")
    if about.st_size > most:
        raise InputError(f"{path}: has {about.st_size:,} bytes; {most:,.0f} are read at most")


@cache
def _is_kernels(device: int) -> bool:
    """Whether the kernel makes up the files of a device, wherever that is mounted."""
    try:
        mounts = Path("/proc/self/mountinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return False
    number = f"{os.major(device)}:{os.minor(device)}"
    halves = (line.partition(" - ") for line in mounts)  # before: numbers and places; behind: the file system
    return any(place.split()[2] == number and kind.split()[0] in _KERNEL_TYPES for place, _, kind in halves)


def open_file(path: Path, most: float = math.inf) -> io.BufferedReader:
    """Open a plain file, which is checked before and again once it is open: what was checked is what is read.

    Raises:
        InputError: It is no plain file, or too large.
        OSError: There is no such file, or it cannot be opened.
    """
    check_file(path, most)  # first, for to open a device may be enough to set it going
    file = open(path, "rb", opener=_open_at_once)  # noqa: SIM115  the caller closes it
    try:
        _check(path, os.fstat(file.fileno()), most)
    except BaseException:
        file.close()
        raise
    return file


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))  # a pipe in place of the file keeps nobody waiting


def holds(path: Path, content: bytes) -> bool:
    """Whether there is a plain file with just that content."""
    try:
        with open_file(path, len(content)) as file:
            return file.read() == content
    except (OSError, InputError):
        return False


def read_text(path: Path, most: float = TEXT_BYTES) -> str:
    """Return the text of a small file.

    Raises:
        InputError: It cannot be read, is too large, or is no text in UTF-8.
    """
    try:
        with open_file(path, most) as file, io.TextIOWrapper(file, encoding="utf-8-sig") as text:
            return text.read()
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
    with open_file(path, most) as file:
        return parse_json(file.read().decode())


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

    def skip(unraisable: sys.UnraisableHookArgs) -> None:
        if not isinstance(unraisable.exc_value, InputError):
            shown(unraisable)

    old, shown = signal.signal(signal.SIGPROF, look), sys.unraisablehook
    sys.unraisablehook = skip  # a finaliser swallows what is raised in it; the next tick raises again
    signal.setitimer(signal.ITIMER_PROF, _TICK, _TICK)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, old)
        sys.unraisablehook = shown


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
