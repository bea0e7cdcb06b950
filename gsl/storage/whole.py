"""Files and folders that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gsl.errors import GslError


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
        raise GslError(
            f"{folder}: cannot be written: {reason}{named}; free space or choose another folder with out="
        ) from error


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
