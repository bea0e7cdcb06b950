"""The lineage of an artifact: what it was made from and what it built, back to the first log, and if that is true."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from gsl.errors import ArtifactError, InputError
from gsl.storage import manifest
from gsl.storage.hashing import file_hash
from gsl.storage.manifest import Manifest, Parent

LONGEST = 200
"""Generations of a lineage, of which an iteration adds less than ten."""
COPY = "copy it to this place"
REFRESH = "the same commands with force=true bring it up to date"
REPEAT = "the same commands with force=true bring what was made from it up to date"


@dataclass(frozen=True)
class Ancestor:
    """An artifact or a file in a lineage.

    Attributes:
        role: What it is for its child; nothing for the artifact that was asked for.
        place: Where it lies, as seen from here.
        manifest: None for a plain file, and where there is none that can be read.
        problem: What is wrong with it itself, nothing if all is well.
        remedy: What to do about that, where `problem` does not say it.
        parents: What it was made from; nothing where that stands elsewhere in the lineage.
    """

    role: str
    place: Path
    manifest: Manifest | None
    problem: str = ""
    remedy: str = ""
    parents: list[Ancestor] = field(default_factory=list)

    @property
    def absent(self) -> bool:
        """Whether there is nothing at its place; that is no damage."""
        return self.remedy == COPY

    def all(self) -> Iterator[Ancestor]:
        """Yield everything above it, the first log first, and itself last."""
        for parent in self.parents:
            yield from parent.all()
        yield self


class Problem(NamedTuple):
    """What is wrong, and what to do about it; nothing if all is well."""

    what: str = ""
    remedy: str = ""


Seen = dict[Path, tuple[Manifest, Problem]]
"""Artifacts that were looked at, by absolute path, and what is wrong with their files: each is hashed once."""


def lineage(folder: Path, seen: Seen) -> Ancestor:
    """Return an artifact with all that is above it, every file hashed again; what is in `seen` is not followed."""
    return _trace(None, folder, folder, seen, 0)


def _trace(of: Parent | None, place: Path, child: Path, seen: Seen, depth: int) -> Ancestor:
    """Return what lies at a place as the parent `of` a child, None for what was asked for."""
    again, role, expected = seen.get(place.absolute()), of.role if of else "", of.hash if of else None
    try:
        if again is None and of and not place.exists():
            return Ancestor(role, place, None, absence(child), COPY)
        if again is None and place.is_file():
            return Ancestor(role, place, None, *_judge(file_hash(place), expected, "was changed since"))
        stored, damage = again or _look_at(place)
    except (InputError, OSError) as error:
        return Ancestor(role, place, None, str(error).removeprefix(f"{place}: ").removeprefix(f"{place}/"))
    problem = damage if damage.what else _judge(stored.contents, expected, "was built anew since")
    if again is not None:
        return Ancestor(role, place, stored, *problem)
    if depth == LONGEST:
        too_far = Problem(f"is {LONGEST} generations back; what it was made from is not looked at")
        return Ancestor(role, place, stored, *(problem if problem.what else too_far))
    seen[place.absolute()] = stored, damage
    made = (*stored.parents, *stored.links)
    above = [_trace(each, _place(place, each), place, seen, depth + 1) for each in made]
    return Ancestor(role, place, stored, *problem, parents=above)


def _look_at(folder: Path) -> tuple[Manifest, Problem]:
    """Return the manifest of an artifact, and what is wrong with its files."""
    stored = manifest.read(folder)
    if damaged := manifest.find_damage(folder, stored):
        return stored, Problem(f"{damaged} {manifest.describe_damage(folder, damaged)}", manifest.REMEDY)
    if strange := next(manifest.strange_files(folder, stored), None):
        return stored, Problem(f"{strange} {manifest.STRANGE}", manifest.TAKE_OUT)
    return stored, Problem()


def absence(child: Path) -> str:
    """Return what is wrong with what `child` was made from and that is not there."""
    return f"is not here, and {child.as_posix()} was made from it"


def _place(folder: Path, parent: Parent) -> Path:
    return Path(os.path.relpath(folder / parent.path))


def _judge(there: str, expected: str | None, problem: str) -> Problem:
    """Return what is wrong where another hash is expected."""
    return Problem() if expected in (None, there) else Problem(problem, REPEAT)


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


def out_of_date(folder: Path, read: Callable[[Path], Manifest] = manifest.read, *, damaged: bool = True) -> str | None:
    """Return which artifact above this one was built anew after it was used, by the manifests alone.

    Args:
        folder: Of the artifact.
        read: Reads the manifest of a folder; who asks for many artifacts keeps what it has read.
        damaged: Whether a manifest above that cannot be read is returned as well: it may be mended.
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
            near = (place.parent, place.parent.parent) if place.is_file() else (place,)  # a log is named by its file
            whole = next((up for up in near if (up / manifest.NAME).is_file()), None)
            if whole is None:
                continue  # a file of nobody's, or gone: that nobody can say
            try:
                stored = read(whole)
            except ArtifactError as error:
                if whole != place or not damaged:
                    continue
                return str(error)
            file = stored.files.get(place.relative_to(whole).as_posix())
            if whole != place and file is None:
                continue  # beside an artifact, and nobody's
            if parent.hash != (file.sha256 if file else stored.contents):
                return f"{whole.as_posix()} was built anew since {child.as_posix()} was made from it"
            waiting.append(whole)
    return None
