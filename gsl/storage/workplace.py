"""The hidden folder beside an artifact in which it is built, under a lock, until it is complete."""

from __future__ import annotations

import fcntl
import logging
import os
import re
import shutil
import signal
import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from gsl.core.budget import holds
from gsl.errors import ArtifactError
from gsl.storage.hashing import LOG, STEPS
from gsl.storage.whole import claim, exchange, explain_refusal, flush, remove_temporary

KEY = ".key"


@contextmanager
def hold_lock(out: Path) -> Iterator[None]:
    """Hold the only right to build `out`, in a file beside it that is gone afterwards.

    Raises:
        ArtifactError: Another process is building it.
        GslError: The folder around it cannot be written.
    """
    lock = out.with_name(f".{out.name}.lock")
    with claim(out):
        made = [folder for folder in (out.parent, *out.parent.parents) if not folder.exists()]
        out.parent.mkdir(parents=True, exist_ok=True)
        descriptor = _take(out, lock)
    try:
        recover(out)
        yield
    finally:
        recover(out)
        lock.unlink(missing_ok=True)
        os.close(descriptor)
        for folder in made:
            with suppress(OSError):
                folder.rmdir()  # of a command that was refused; what holds something stays


def _take(out: Path, lock: Path) -> int:
    while True:
        if lock.is_symlink():  # a stranger's: nothing is made where it leads
            lock.unlink()
        descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            os.close(descriptor)
            raise ArtifactError(out, "another process is building it; wait for it or choose another out=") from error
        if lock.exists() and os.path.samestat(os.fstat(descriptor), lock.stat()):
            return descriptor
        os.close(descriptor)


def recover(out: Path) -> None:
    """Put right what a killed or stopped process left: an artifact moved aside comes back, temporary folders go."""
    aside = _aside(out)
    temporary = re.compile(rf"\.{re.escape(out.name)}\.tmp-\d+")  # the name may hold a star
    with explain_refusal(out.parent):
        if aside.exists() and not out.exists():
            os.rename(aside, out)
        for leftover in [aside, *(path for path in out.parent.iterdir() if temporary.fullmatch(path.name))]:
            shutil.rmtree(leftover, ignore_errors=True)


@contextmanager
def workplace(out: Path, key: str, *, progress: str, kept: Collection[str] = ()) -> Iterator[Path]:
    """Yield the folder to build `out` in; it goes when the block fails, unless the file `progress` holds something.

    Args:
        out: Folder of the artifact.
        key: Of the work; what other work has left goes.
        progress: File that the work goes on from; none if it cannot.
        kept: Files and folders that it goes on from as well; whatever else a kill left goes.
    """
    folder = _partial(out) if progress else out.with_name(f".{out.name}.tmp-{os.getpid()}")
    with explain_refusal(out.parent):
        if folder.is_symlink():
            folder.unlink()
        if folder.exists() and not holds(folder / KEY, key.encode()):
            shutil.rmtree(folder)
        folder.mkdir(exist_ok=True)
        _clear(folder, {progress, KEY, LOG, STEPS, *kept})
        (folder / KEY).write_text(key)
    try:
        yield folder
    finally:
        if not (progress and (folder / progress).is_file() and (folder / progress).stat().st_size):
            shutil.rmtree(folder, ignore_errors=True)


def _clear(folder: Path, kept: Collection[str]) -> None:
    """Remove what a kill left but the work does not go on from, so that it does not become part of the artifact.

    Links go, wherever they are: work that went on through one would write somewhere else.
    """
    for path in folder.rglob("*"):
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            path.unlink()
    for path in folder.iterdir():
        if path.name not in kept:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    remove_temporary(folder)


def install(folder: Path, out: Path) -> None:
    """Give the finished `folder` the name `out`; an artifact of that name stays until this moment."""
    (folder / KEY).unlink(missing_ok=True)
    flush(folder)
    old = folder if out.exists() and exchange(folder, out) else _aside(out)
    if old != folder:
        if out.exists():
            os.rename(out, old)
        os.rename(folder, out)
    flush(out.parent)
    shutil.rmtree(old, ignore_errors=True)


def complete(out: Path) -> Path | None:
    """Return the folder that a kill left in the middle of `install`: the new artifact, or the one it has replaced."""
    folder = _partial(out)
    return folder if folder.is_dir() and not (folder / KEY).exists() else None


def _partial(out: Path) -> Path:
    return out.with_name(f".{out.name}.partial")


def _aside(out: Path) -> Path:
    return out.with_name(f".{out.name}.replaced")


class _LogFile(logging.FileHandler):
    """One whose disk may be full: that ends the work like any other file that cannot be written."""

    def handleError(self, record: logging.LogRecord) -> None:
        """Let the error go on: logging's own way is a traceback on stderr."""
        raise


class _Others(logging.Handler):
    """Whoever listens to the program's log beside the file: they hear what they would without it."""

    def __init__(self, level: int, *, listening: bool) -> None:
        super().__init__(level)
        self.listening = listening

    def emit(self, record: logging.LogRecord) -> None:
        """Pass a record on, if anybody listens: logging itself would print what nobody handles."""
        if self.listening and (root := logging.getLogger()).handlers:
            root.handle(record)


_hearing: list[tuple[int, _Others]] = []  # what was before, once for each file that is written
_one = threading.Lock()


def _begin_hearing(logger: logging.Logger) -> None:
    with _one:
        before = (logger.level, _Others(logger.getEffectiveLevel(), listening=logger.propagate))
        if not _hearing:
            logger.addHandler(before[1])
            logger.setLevel(min(logger.level, logging.INFO) or logging.INFO)
            logger.propagate = False
        _hearing.append(_hearing[0] if _hearing else before)


def _end_hearing(logger: logging.Logger) -> None:
    with _one:
        level, others = _hearing.pop()
        if not _hearing:
            logger.propagate = others.listening
            logger.setLevel(level)
            logger.removeHandler(others)


@contextmanager
def log_to(folder: Path) -> Iterator[logging.Logger]:
    """Write what gsl logs to the folder's log file, too; resumed work goes on in the same file."""
    logger = logging.getLogger("gsl")
    handler = _LogFile(folder / LOG, encoding="utf-8")
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    _begin_hearing(logger)
    logger.addHandler(handler)
    try:
        yield logger
    finally:
        _end_hearing(logger)
        logger.removeHandler(handler)
        handler.close()


@contextmanager
def stoppable() -> Iterator[None]:
    """Let SIGTERM stop the block as Ctrl-C does, so that it can tidy up; a handler of somebody else's stays."""
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _interrupt(number: int, frame: Any) -> None:
    raise KeyboardInterrupt
