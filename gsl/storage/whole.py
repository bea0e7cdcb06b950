"""Files and folders that appear whole or not at all."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gsl.errors import GslError

_REMEDIES = {
    errno.ENOSPC: "free space or choose another folder with out=",
    errno.EDQUOT: "free space or choose another folder with out=",
    errno.EACCES: "give yourself the right to write or choose another folder with out=",
    errno.EPERM: "give yourself the right to write or choose another folder with out=",
}


@contextmanager
def explained(folder: Path) -> Iterator[None]:
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
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary name beside `path` that takes its place when the block ends well and vanishes when not."""
    temporary = path.with_name(f".{path.name}.tmp-{os.getpid()}")
    with explained(path.parent):
        try:
            yield temporary
            flush(temporary)
            os.replace(temporary, path)
        finally:
            if temporary.is_file():
                temporary.unlink()


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
