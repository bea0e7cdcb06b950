"""Files and folders that appear whole or not at all."""

from __future__ import annotations

import ctypes
import errno
import glob
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gsl.errors import GslError, InputError

_REMEDIES = {
    errno.ENOSPC: "free space or choose another folder with out=",
    errno.EDQUOT: "free space or choose another folder with out=",
    errno.EACCES: "give yourself the right to write or choose another folder with out=",
    errno.EPERM: "give yourself the right to write or choose another folder with out=",
}


_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG}
_NO_PLACE = {errno.ENOENT, errno.ENOTDIR, errno.EEXIST, errno.ELOOP, errno.ENAMETOOLONG, errno.EINVAL}
_TEMPORARY = re.compile(r"\..+\.tmp-\d+")
_HERE, _EXCHANGE = -100, 2  # AT_FDCWD, RENAME_EXCHANGE: linux/fcntl.h, linux/fs.h


@contextmanager
def explain_refusal(folder: Path) -> Iterator[None]:
    """Turn an operating system's refusal to write (full, read-only, not a folder) into one line that names `folder`."""
    try:
        yield
    except (FileNotFoundError, ConnectionError, ChildProcessError, TimeoutError):
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        named = f" ({error.filename})" if error.filename else ""
        remedy = _REMEDIES.get(error.errno or 0, "choose another folder with out=")
        place = folder.parent if folder.name.startswith(".") else folder  # what is hidden is gone when this is read
        raise GslError(f"{place}: cannot be written: {reason}{named}; {remedy}") from error


@contextmanager
def claim(out: Path) -> Iterator[None]:
    """Within, the place of a new folder is made ready; where the system knows no such place, it is wrong.

    Raises:
        InputError: There can be no folder, such as below a file or in /proc.
        GslError: It cannot be written.
    """
    try:
        with explain_refusal(out.parent):
            yield
    except (FileNotFoundError, GslError) as error:
        reason = error if isinstance(error, OSError) else error.__cause__
        if isinstance(reason, OSError) and reason.errno in _NO_PLACE:
            raise InputError(f"{out}: there can be no folder here ({reason.strerror}); choose another out=") from error
        raise


@contextmanager
def explain_failures(folder: Path) -> Iterator[None]:
    """Do so with a refusal to write in `folder`, its subfolders of other work left out; any other stays what it is."""
    try:
        yield
    except OSError as error:
        refused = error.errno in (errno.EACCES, errno.EPERM) and error.filename is None
        if not (refused or error.errno in _FULL or _is_hidden_in(folder, error.filename)):
            raise
        with explain_refusal(folder):
            raise


def _is_hidden_in(folder: Path, path: object) -> bool:
    """Whether a path is below a hidden entry of `folder`, as work that is not finished is."""
    if not isinstance(path, str | os.PathLike):
        return False
    place, home = Path(os.path.abspath(path)), Path(os.path.abspath(folder))
    return place.is_relative_to(home) and place != home and place.relative_to(home).parts[0].startswith(".")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary name beside `path` that takes its place when the block ends well and vanishes when not.

    The temporary file of an earlier, killed process goes.
    """
    temporary = path.with_name(f".{path.name}.tmp-{os.getpid()}")
    with explain_refusal(path.parent):
        for other in path.parent.glob(f".{glob.escape(path.name)}.tmp-*"):
            if other.is_file() and not is_alive(other.name.rpartition("-")[2]):
                other.unlink(missing_ok=True)
        try:
            yield temporary
            flush(temporary)
            os.replace(temporary, path)
            flush(path.parent)
        finally:
            if temporary.is_file():
                temporary.unlink()


def is_alive(process: str) -> bool:
    """Whether a process of this number runs on this machine; a word that is no number counts as running."""
    if not process.isdecimal():
        return True
    try:
        os.kill(int(process), 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


def remove_temporary(folder: Path) -> None:
    """Remove the files below `folder` that a killed `replacing` left."""
    for path in [path for path in folder.rglob(".*") if _TEMPORARY.fullmatch(path.name) and path.is_file()]:
        path.unlink()


def exchange(first: Path, other: Path) -> bool:
    """Let two folders swap their names in one step; False where the system cannot (not Linux, or NFS)."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except AttributeError:
        return False
    return bool(rename(_HERE, os.fsencode(first), _HERE, os.fsencode(other), _EXCHANGE) == 0)


def flush(path: Path) -> None:
    """Wait until a file or the entries of a folder are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def flush_tree(folder: Path) -> None:
    """Wait until everything below `folder` is on the disk."""
    for path in [*folder.rglob("*"), folder]:
        flush(path)
