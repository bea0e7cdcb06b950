"""The lineage of an artifact: what it was made from and what it built, back to the first log, and if that is true."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from gsl.errors import ArtifactError, InputError
from gsl.storage import manifest
from gsl.storage.hashing import file_hash
from gsl.storage.manifest import Manifest, Parent

LONGEST = 200
"""Generations of a lineage, of which an iteration adds less than ten."""


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


Seen = dict[Path, tuple[Manifest, str]]
"""Artifacts that were looked at, by absolute path, and what is wrong with their files: each is hashed once."""


def lineage(folder: Path, seen: Seen) -> Ancestor:
    """Return an artifact with all that is above it, every file hashed again; what is in `seen` is not followed."""
    return _trace("", folder, None, seen, 0)


def _trace(role: str, place: Path, expected: str | None, seen: Seen, depth: int) -> Ancestor:
    again = seen.get(place.absolute())
    try:
        if again is None and place.is_file():
            return Ancestor(role, place, None, _file_problem(place, expected))
        stored, damage = again or _look_at(place)
    except (InputError, OSError) as error:
        return Ancestor(role, place, None, str(error).removeprefix(f"{place}: ").removeprefix(f"{place}/"))
    problem = damage or ("was built anew since" if expected not in (None, stored.contents) else "")
    if again is not None:
        return Ancestor(role, place, stored, problem)
    if depth == LONGEST:
        too_far = f"is {LONGEST} generations back; what it was made from is not looked at"
        return Ancestor(role, place, stored, problem or too_far)
    seen[place.absolute()] = stored, damage
    made = (*stored.parents, *stored.links)
    above = [_trace(each.role, _place(place, each), each.hash, seen, depth + 1) for each in made]
    return Ancestor(role, place, stored, problem, above)


def _look_at(folder: Path) -> tuple[Manifest, str]:
    """Return the manifest of an artifact, and what is wrong with its files, nothing if all is well."""
    stored = manifest.read(folder)
    if damaged := manifest.find_damage(folder, stored):
        return stored, f"{damaged} {manifest.describe_damage(folder, damaged)}"
    strange = manifest.strange_file(folder, stored)
    return stored, f"{strange} is no file of the artifact" if strange else ""


def _place(folder: Path, parent: Parent) -> Path:
    return Path(os.path.relpath(folder / parent.path))


def _file_problem(place: Path, expected: str | None) -> str:
    return "was changed since" if expected not in (None, file_hash(place)) else ""


def broken_link(folder: Path, stored: Manifest) -> str | None:
    """Return what is wrong with the first artifact that this one built beside itself and that is not as it left it."""
    for link in stored.links:
        place = _place(folder, link)
        try:
            linked = manifest.read(place)
        except ArtifactError as error:
            return f"gone or damaged: {error.path.as_posix()}"
        if damaged := manifest.find_damage(place, linked):
            return f"changed since: {(place / damaged).as_posix()}"
        if linked.contents != link.hash:
            return f"built anew since: {place.as_posix()}"
    return None


def out_of_date(folder: Path, read: Callable[[Path], Manifest] = manifest.read) -> str | None:
    """Return which artifact above this one was built anew after it was used, by the manifests alone.

    Args:
        folder: Of the artifact.
        read: Reads the manifest of a folder; who asks for many artifacts keeps what it has read.
    """
    waiting, seen = [folder], set[Path]()
    while waiting:
        child = waiting.pop()
        if child.absolute() in seen or child.is_file():
            continue
        seen.add(child.absolute())
        try:
            parents = read(child).parents
        except ArtifactError:
            continue
        for parent in parents:
            place = _place(child, parent)
            if not (place / manifest.NAME).is_file():
                continue  # a file, or gone: that nobody can say
            try:
                same = read(place).contents == parent.hash
            except ArtifactError as error:
                return str(error)
            if not same:
                return f"{place.as_posix()} was built anew since {child.as_posix()} was made from it"
            waiting.append(place)
    return None
