"""The lineage of an artifact: what it was made from and what it built, back to the first log, and if that is true."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from gsl.errors import ArtifactError, InputError
from gsl.storage import manifest
from gsl.storage.hashing import file_hash
from gsl.storage.manifest import Manifest, Parent


@dataclass(frozen=True)
class Ancestor:
    """An artifact or a file in a lineage.

    Attributes:
        role: What it is for its child; nothing for the artifact that was asked for.
        place: Where it lies, as seen from here.
        manifest: None for a plain file, and where there is none that can be read.
        problem: What is wrong with it itself, nothing if all is well.
        parents: What it was made from; nothing where that stands elsewhere in the lineage.
    """

    role: str
    place: Path
    manifest: Manifest | None
    problem: str
    parents: list[Ancestor] = field(default_factory=list)

    def all(self) -> Iterator[Ancestor]:
        """Yield everything above it, the first log first, and itself last."""
        for parent in self.parents:
            yield from parent.all()
        yield self


def lineage(folder: Path, seen: set[Path]) -> Ancestor:
    """Return an artifact with all that is above it, every file hashed again; what is in `seen` is not followed."""
    return _trace("", folder, None, seen)


def _trace(role: str, place: Path, expected: str | None, seen: set[Path]) -> Ancestor:
    try:
        stored = None if place.is_file() else manifest.read(place)
        problem = _file_problem(place, expected) if stored is None else _problem(place, stored, expected)
    except (InputError, OSError) as error:
        return Ancestor(role, place, None, str(error).removeprefix(f"{place}: ").removeprefix(f"{place}/"))
    if stored is None or place.absolute() in seen:
        return Ancestor(role, place, stored, problem)
    seen.add(place.absolute())
    above = [_trace(one.role, _place(place, one), one.hash, seen) for one in (*stored.parents, *stored.links)]
    return Ancestor(role, place, stored, problem, above)


def _place(folder: Path, parent: Parent) -> Path:
    return Path(os.path.relpath(folder / parent.path))


def _file_problem(place: Path, expected: str | None) -> str:
    return "was changed since" if expected not in (None, file_hash(place)) else ""


def _problem(folder: Path, stored: Manifest, expected: str | None) -> str:
    if damaged := manifest.find_damage(folder, stored):
        return f"{damaged} {manifest.describe_damage(folder, damaged)}"
    if strange := manifest.strange_file(folder, stored):
        return f"{strange} is no file of the artifact"
    return "was built anew since" if expected not in (None, stored.contents) else ""


def broken_link(folder: Path, stored: Manifest) -> str | None:
    """Return what is wrong with the first artifact that this one built beside itself and that is not as it left it."""
    for link in stored.links:
        place = _place(folder, link)
        try:
            found = manifest.read(place)
        except ArtifactError as error:
            return f"gone or damaged: {error.path.as_posix()}"
        if damaged := manifest.find_damage(place, found):
            return f"changed since: {(place / damaged).as_posix()}"
        if found.contents != link.hash:
            return f"built anew since: {place.as_posix()}"
    return None


def out_of_date(folder: Path, seen: set[Path] | None = None) -> str | None:
    """Return which artifact above this one was built anew after it was used, by the manifests alone."""
    seen = set() if seen is None else seen
    if folder.absolute() in seen or folder.is_file():
        return None
    seen.add(folder.absolute())
    try:
        parents = manifest.read(folder).parents
    except ArtifactError:
        return None
    for parent in parents:
        place = _place(folder, parent)
        if not (place / manifest.NAME).is_file():
            continue  # a file, or gone: that nobody can say
        try:
            same = manifest.read(place).contents == parent.hash
        except ArtifactError as error:
            return str(error)
        if not same:
            return f"{place.as_posix()} was built anew since {folder.as_posix()} was made from it"
        if above := out_of_date(place, seen):
            return above
    return None
