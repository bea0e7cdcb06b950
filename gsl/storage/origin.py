"""How the artifact that a stage is at work on comes about: command, settings, what it is made from and has built."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gsl.core.budget import DOCUMENT_BYTES, open_file
from gsl.core.visible import visible
from gsl.errors import InputError
from gsl.storage.hashing import LOG
from gsl.storage.manifest import Parent

if TYPE_CHECKING:
    from gsl.storage.artifact import Artifact

WARNINGS = 50  # that a page lists
_WARNING = re.compile(r" gsl: warning: (.*)")


@dataclass(frozen=True)
class Origin:
    """How an artifact comes about.

    Attributes:
        command: As it was typed.
        settings: All of them, as config.yaml has them.
        parents: What it is made from.
        folder: Where it is made.
        out: Where it lies afterwards, as the command has it.
        built: What has been built beside it so far, by absolute path; it grows.
    """

    command: str
    settings: str
    parents: tuple[Parent, ...]
    folder: Path
    out: Path
    built: Mapping[Path, Artifact]

    @property
    def links(self) -> tuple[Parent, ...]:
        """What has been built beside it, as its manifest names it."""
        return tuple(
            Parent(artifact.manifest.kind, relative(path, self.folder), artifact.manifest.contents)
            for path, artifact in sorted(self.built.items())
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the console has warned of since the work began, and while what it built was made: the logs have it."""
        logs = [self.folder / LOG, *(path / LOG for path in sorted(self.built))]
        lines = [line for log in logs for line in _read_log(log).splitlines()]
        said = list(dict.fromkeys(visible(match[1]) for line in lines if (match := _WARNING.search(line))))
        more = [f"{len(said) - WARNINGS} more, in the logs"] if len(said) > WARNINGS else []
        return (*said[:WARNINGS], *more)


def _read_log(path: Path) -> str:
    """Return a log, or nothing of one that cannot be read: no work fails because of what it says of itself."""
    try:
        with open_file(path, DOCUMENT_BYTES) as file:
            return file.read().decode(errors="replace")
    except (InputError, OSError):
        return ""


_at_work: ContextVar[Origin | None] = ContextVar("at_work", default=None)


@contextmanager
def at_work(origin: Origin) -> Iterator[Origin]:
    """Let a stage see, within, how its artifact comes about."""
    token = _at_work.set(origin)
    try:
        yield origin
    finally:
        _at_work.reset(token)


def origin() -> Origin | None:
    """Return how the artifact of the stage that is at work comes about, None where no stage is."""
    return _at_work.get()


def relative(path: Path, folder: Path) -> str:
    """Return a path as seen from a folder."""
    return Path(os.path.relpath(path, folder)).as_posix()
