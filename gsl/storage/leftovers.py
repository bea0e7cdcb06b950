"""What killed commands have left below a folder of runs, and artifacts that nobody needs: named, sized, removed."""

from __future__ import annotations

import fcntl
import functools
import os
import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from gsl.errors import ArtifactError
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.storage.lineage import out_of_date
from gsl.storage.references import find_all
from gsl.storage.whole import is_alive
from gsl.storage.workplace import hold_lock

MULTIRUN = ".multirun"
_HIDDEN = re.compile(r"\.(?P<name>.+)\.(?:(?P<partial>partial)|replaced|lock|tmp-(?P<process>\d+))")
_WORK = "work of a killed command, which the same command would go on from"
_TEMPORARY = "temporary, of a killed command"


@dataclass(frozen=True)
class Leftover:
    """Something that could go.

    Attributes:
        path: Where it lies.
        why: Why it could go, in a few words.
        bytes: Its size.
        artifact: Whether it is an artifact, of which only the files that its manifest names go.
    """

    path: Path
    why: str
    bytes: int
    artifact: bool = False


def find_leftovers(runs: Path) -> list[Leftover]:
    """Return what is left of killed commands below `runs`; what a process is at work on is left out."""
    return [Leftover(path, why, measure(path)) for path, why in _walk(runs)]


def find_stale(runs: Path, *, stale: bool, orphaned: bool) -> list[Leftover]:
    """Return artifacts below `runs` that were made from one that was built anew since, or from one that is gone."""
    artifacts, reasons = find_all(runs), dict[Path, str]()
    if orphaned:
        reasons |= _find_orphans(artifacts)
    read = functools.cache(manifest.read)
    for folder in (artifact.folder for artifact in artifacts):
        if folder not in reasons and stale and (change := out_of_date(folder, read, damaged=False)):
            reasons[folder] = f"stale: {change}"
    return [Leftover(folder, why, _measure_artifact(folder), artifact=True) for folder, why in reasons.items()]


def _find_orphans(artifacts: Sequence[Artifact]) -> dict[Path, str]:
    """Return which artifacts were made from one that is gone, or from such an orphan, and why each is one."""
    above = {
        artifact.folder: [Path(os.path.normpath(artifact.folder / parent.path)) for parent in artifact.manifest.parents]
        for artifact in artifacts
    }
    reasons = {
        folder: f"orphaned: {gone[0].as_posix()} is gone"
        for folder, places in above.items()
        if (gone := [place for place in places if not place.exists()])
    }
    waiting = list(reasons)
    while waiting:
        orphan = waiting.pop(0)
        for folder, places in above.items():
            if folder not in reasons and any(place.is_relative_to(orphan) for place in places):
                reasons[folder] = f"orphaned: {orphan.as_posix()}, from which it was made, is an orphan"
                waiting.append(folder)
    return reasons


def remove(leftover: Leftover, runs: Path) -> bool:
    """Remove it, and the folders that are empty then; False where a process is at work on it now.

    Only what lies inside `runs` goes; a link is removed, never what it leads to.
    """
    path = leftover.path
    if not _is_inside(path.parent, runs):
        return False
    hidden = _HIDDEN.fullmatch(path.name)
    try:
        if path.parent.name == MULTIRUN:
            with hold(path) as free:
                if not free:
                    return False
                _erase(path)
        else:
            with hold_lock(path.with_name(hidden["name"]) if hidden else path):  # which recovers what it can
                if leftover.artifact:
                    _erase_artifact(path)
                elif os.path.lexists(path) and not path.name.endswith(".lock"):
                    _erase(path)
    except ArtifactError:
        return False
    for folder in path.parents:
        if folder == runs or not folder.is_relative_to(runs):
            break
        with suppress(OSError):
            folder.rmdir()
    return True


def measure(path: Path) -> int:
    """Return the size of a file, or of all files below a folder; links do not count."""
    if path.is_symlink() or not path.is_dir():
        return path.lstat().st_size if os.path.lexists(path) else 0
    sizes = 0
    for place, _, files in os.walk(path):
        for name in files:
            with suppress(OSError):  # it may go meanwhile
                sizes += os.lstat(os.path.join(place, name)).st_size
    return sizes


def _walk(runs: Path) -> Iterator[tuple[Path, str]]:
    for place, folders, files in os.walk(runs):
        here, below = Path(place), sorted(folders)
        folders[:] = [name for name in below if not name.startswith(".")]
        if MULTIRUN in below and here == runs:
            for job in sorted((here / MULTIRUN).iterdir()):
                if job.is_dir() and not _in_use(job):
                    yield job, "what the jobs of a multirun said that failed or was killed"
        for name in [*below, *sorted(files)]:
            entry = _HIDDEN.fullmatch(name)
            if entry is None or _in_use(here / f".{entry['name']}.lock"):
                continue
            if entry["process"] and is_alive(entry["process"]):
                continue
            yield here / name, _WORK if entry["partial"] else _TEMPORARY


def _in_use(path: Path) -> bool:
    """Whether a process holds a file or folder."""
    try:
        with hold(path) as free:
            return not free
    except FileNotFoundError:
        return False


@contextmanager
def hold(path: Path, *, wait: bool = False) -> Iterator[bool]:
    """Hold a file or folder if nobody else does, or wait for it; yield whether it is held."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        held = True
    except BlockingIOError:
        held = False
    try:
        yield held
    finally:
        os.close(descriptor)


def _is_inside(path: Path, runs: Path) -> bool:
    return path.resolve().is_relative_to(runs.resolve())


def _erase(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink()


def _measure_artifact(folder: Path) -> int:
    return sum(file.bytes for file in manifest.read(folder).files.values()) + measure(folder / manifest.NAME)


def _erase_artifact(folder: Path) -> None:
    """Remove the manifest first, so that what is left after a kill is no artifact, and then the files that it names."""
    files = manifest.read(folder).files
    (folder / manifest.NAME).unlink()
    for path in (folder / name for name in files):
        if _is_inside(path.parent, folder):  # a folder in it may be a link to another artifact
            path.unlink(missing_ok=True)
    for place, _, _ in os.walk(folder, topdown=False):
        with suppress(OSError):  # something of somebody else's is in it
            os.rmdir(place)
