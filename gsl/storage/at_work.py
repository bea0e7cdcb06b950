"""What the stage that is at work was told, and what it has built beside itself so far."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from gsl.storage.manifest import Parent

if TYPE_CHECKING:
    from gsl.storage.artifact import Artifact


class Work(NamedTuple):
    """How an artifact comes about.

    Attributes:
        command: As it was typed.
        settings: All of them, as config.yaml has them.
        parents: What it is made from.
        folder: Where it is made.
    """

    command: str
    settings: str
    parents: tuple[Parent, ...]
    folder: Path


class Origin(NamedTuple):
    """The same for its page, with the links that it has built beside itself so far."""

    command: str
    settings: str
    parents: tuple[Parent, ...]
    links: tuple[Parent, ...]


_work: ContextVar[Work | None] = ContextVar("work", default=None)
_built: ContextVar[dict[Path, Artifact] | None] = ContextVar("built", default=None)  # by absolute path


def origin() -> Origin | None:
    """Return how the artifact of the stage that is at work comes about, None where no stage is."""
    if (work := _work.get()) is None:
        return None
    return Origin(work.command, work.settings, work.parents, links_of(_built.get() or {}, work.folder))


def links_of(built: Mapping[Path, Artifact], folder: Path) -> tuple[Parent, ...]:
    """Return artifacts as the manifest of one in a folder has them."""
    return tuple(
        Parent(one.manifest.kind, relative(path, folder), one.manifest.contents) for path, one in built.items()
    )


def relative(path: Path, folder: Path) -> str:
    """Return how a manifest in a folder says a path."""
    return Path(os.path.relpath(path, folder)).as_posix()


def note(artifact: Artifact) -> Artifact:
    """Note an artifact as a link of the stage that is at work."""
    if (built := _built.get()) is not None:
        built[artifact.folder.absolute()] = artifact
    return artifact


@contextmanager
def work_at(work: Work) -> Iterator[Mapping[Path, Artifact]]:
    """Within, a stage is at work; yield what it builds."""
    token = _work.set(work)
    try:
        with collect_links() as links:
            yield links
    finally:
        _work.reset(token)


@contextmanager
def collect_links() -> Iterator[Mapping[Path, Artifact]]:
    """Within, the artifacts that are built or are there already are collected, by absolute path."""
    links: dict[Path, Artifact] = {}
    token = _built.set(links)
    try:
        yield links
    finally:
        _built.reset(token)
