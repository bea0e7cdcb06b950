"""The manifest of an artifact: what it is, what it was made from, and the hash of every file in it."""

from __future__ import annotations

import dataclasses
import hashlib
import os
from collections.abc import Collection, Container, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from gsl.core.budget import ARTIFACT_BYTES, MANIFEST_BYTES, read_json
from gsl.core.unit import Unit
from gsl.errors import ArtifactError, InputError
from gsl.storage import documents
from gsl.storage.hashing import CIRCUMSTANCES, contents_hash, file_hash

SCHEMA_VERSION = 2
WITHOUT_HASH = 1  # the version before, which is still read
NAME = "manifest.json"
HASH = "sha256"
"""Key of the hash of all other entries."""

ALWAYS = frozenset({"config.yaml", "log.txt", "metrics.json"})  # files that no artifact lacks
NOT_HELD = "not_held.txt"  # of an export: what its format lacks
ABOUT = ALWAYS | {*CIRCUMSTANCES, NOT_HELD}
"""Names of files that tell of an artifact and hold none of its data."""
REMEDY = "copy the run again, or build it anew with force=true"
"""What to do about an artifact that is not as it was made."""
STRANGE, TAKE_OUT = "is no file of the artifact", "take it out of the folder"

LONGEST = 1e12  # of a duration [s]
PATH = 4096  # bytes of a path: linux/limits.h
FIRST, LAST = 1970, 9998  # years: a moment of another one may be none in another time zone
_KINDS: Mapping[str, type | tuple[type, ...]] = {
    **dict.fromkeys(("kind", "key", "command", "sources", "created", "metrics"), str),
    **dict.fromkeys(("seeds", "versions"), dict),
    **dict.fromkeys(("git", "unit"), (dict, type(None))),
    "duration": (int, float),
}
"""What entries have to be that are taken as they are."""


@dataclass(frozen=True)
class File:
    """A file of an artifact: the hash of its contents and its size [bytes]."""

    sha256: str
    bytes: int


@dataclass(frozen=True)
class Parent:
    """What an artifact was made from: its role, its path from the artifact's folder, the hash of its contents."""

    role: str
    path: str
    hash: str


@dataclass(frozen=True)
class Manifest:
    """Everything known about an artifact; its presence in the folder means that the artifact is complete.

    Attributes:
        kind: What the artifact is, such as `collect`.
        key: Hash of settings, parents' contents and gsl's sources: equal keys mean equal work.
        command: Command line that built it.
        files: Every other file of the folder by its name in it.
        parents: What it was made from.
        seeds: The seeds among its settings, by dotted name.
        sources: Hash of gsl's sources.
        versions: Versions of gsl, Python and the libraries that matter.
        git: Commit and dirty flag, None outside a repository.
        created: Coordinated universal time, ISO 8601.
        duration: Time the work took [s].
        links: The artifacts that it built beside itself, as an iteration does; their roles are their paths.
        metrics: Name of the file that holds the metrics.
        trust: Modules that are not gsl's and whose code took part: what its settings name, and what `trust=` named.
        unit: How values of its task are shown (`gsl.core.unit.Unit`), None where there is no task.
        schema_version: Version of this contract.
    """

    kind: str
    key: str
    command: str
    files: Mapping[str, File]
    parents: tuple[Parent, ...]
    seeds: Mapping[str, int]
    sources: str
    versions: Mapping[str, str | None]
    git: Mapping[str, Any] | None
    created: str
    duration: float
    links: tuple[Parent, ...] = ()
    metrics: str = "metrics.json"
    unit: Mapping[str, Any] | None = None
    trust: tuple[str, ...] = ()
    schema_version: int = SCHEMA_VERSION

    @property
    def contents(self) -> str:
        """Hash of the artifact's contents, as its children record it."""
        return contents_hash(self.kind, {name: file.sha256 for name, file in self.files.items()})


def inventory(folder: Path) -> dict[str, File]:
    """Return every file below `folder` but its manifest, by name in it."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file() and path != folder / NAME)
    return {path.relative_to(folder).as_posix(): File(file_hash(path), path.stat().st_size) for path in paths}


def find_damage(folder: Path, manifest: Manifest, only: Container[str] | None = None) -> str | None:
    """Return the first file that is missing or not what the manifest says, None when the artifact's own are intact."""
    place, total = folder.resolve(), sum(file.bytes for file in manifest.files.values())
    if total > ARTIFACT_BYTES:
        raise ArtifactError(folder, f"says that it holds {total:,} bytes; {ARTIFACT_BYTES:,} are read")
    for name, file in manifest.files.items():
        if only is not None and name not in only:
            continue
        path = folder / name
        if not path.resolve().is_relative_to(place):
            raise ArtifactError(path, "leads out of the artifact; nothing of it is read")
        if not path.is_file() or path.stat().st_size != file.bytes or file_hash(path) != file.sha256:
            return name
    return None


def describe_damage(folder: Path, name: str) -> str:
    """Return what is wrong with a damaged file: that it is gone, or not as it was written."""
    return "is not as the manifest says" if (folder / name).is_file() else "is missing"


def check_intact(folder: Path, manifest: Manifest, only: Container[str] | None = None) -> None:
    """Refuse an artifact of which a file is missing or was changed; `only` these files, by default all.

    Raises:
        ArtifactError: It names the file.
    """
    if damaged := find_damage(folder, manifest, only):
        raise damage(folder, damaged)


def damage(folder: Path, name: str) -> ArtifactError:
    """Return the error for a damaged file of an artifact, which says what to do."""
    return ArtifactError(folder / name, f"{describe_damage(folder, name)}; {REMEDY}")


def check_files(folder: Path, manifest: Manifest, names: Collection[str]) -> None:
    """Refuse these files of the folder if one is missing, was changed, or is none of the artifact.

    Raises:
        ArtifactError: It names the file.
    """
    if strange := sorted({*names} - manifest.files.keys()):
        raise ArtifactError(folder / strange[0], f"{STRANGE}; {TAKE_OUT}")
    check_intact(folder, manifest, only=names)


def strange_files(folder: Path, manifest: Manifest) -> Iterator[str]:
    """Yield the files of the folder that the manifest does not name; hidden ones and other artifacts are none."""
    for place, folders, files in os.walk(folder):
        here = Path(place)
        folders[:] = sorted(name for name in folders if name[0] != "." and not (here / name / NAME).is_file())
        for name in sorted(files):
            path = (here / name).relative_to(folder).as_posix()
            if name[0] != "." and path != NAME and path not in manifest.files:
                yield path


def write(folder: Path, manifest: Manifest) -> None:
    """Write the manifest, which declares the artifact complete."""
    stored = dataclasses.asdict(manifest)
    documents.write_json(folder / NAME, {**stored, HASH: hash_entries(stored)})


def hash_entries(stored: Mapping[str, Any]) -> str:
    """Return the hash of a manifest's entries, which stands beside them."""
    return hashlib.sha256(documents.text(stored).encode()).hexdigest()


def read(folder: Path) -> Manifest:
    """Read the manifest of the artifact in `folder`.

    Raises:
        ArtifactError: There is none, or it is foreign, damaged or of another version.
    """
    if not folder.exists():
        raise ArtifactError(folder, "does not exist")
    try:
        stored = read_json(folder / NAME, MANIFEST_BYTES)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise ArtifactError(folder, f"is no complete artifact: it holds no {NAME}") from error
    except OSError as error:
        raise ArtifactError(folder / NAME, f"cannot be read: {error.strerror}") from error
    except InputError as error:  # no plain file, or too large
        raise ArtifactError(folder / NAME, str(error).removeprefix(f"{folder / NAME}: ")) from error
    except (ValueError, RecursionError) as error:
        raise ArtifactError(folder / NAME, f"is damaged: it is not JSON; {REMEDY}") from error
    version = stored.get("schema_version") if isinstance(stored, dict) else None
    if version not in (SCHEMA_VERSION, WITHOUT_HASH):
        raise ArtifactError(folder / NAME, f"schema_version {version!r} is unknown; this gsl reads {SCHEMA_VERSION}")
    try:
        if version == SCHEMA_VERSION and stored.pop(HASH) != hash_entries(stored):
            raise ArtifactError(folder / NAME, f"is damaged: it is not as it was written; {REMEDY}")
        parsed = _parse(stored)
    except (TypeError, AttributeError, KeyError, ValueError, RecursionError) as error:
        raise ArtifactError(folder / NAME, f"is damaged: its entries do not fit; {REMEDY}") from error
    if missing := sorted({*ALWAYS, parsed.metrics} - parsed.files.keys()):
        raise ArtifactError(folder / NAME, f"is damaged: it does not name {missing[0]}; {REMEDY}")
    return parsed


def resembles(folder: Path) -> bool:
    """Whether a folder whose manifest cannot be read was an artifact: it has the files that none lacks."""
    return all((folder / name).is_file() for name in (NAME, *ALWAYS))


def _parse(stored: dict[str, Any]) -> Manifest:
    files = {name: File(**file) for name, file in stored.pop("files").items()}
    parents = tuple(Parent(**parent) for parent in stored.pop("parents"))
    links = tuple(Parent(**link) for link in stored.pop("links", ()))
    trust = tuple(stored.pop("trust", ()))
    for name, kinds in _KINDS.items():
        if name in stored and not isinstance(stored[name], kinds):
            raise ValueError(f"{name} is of another kind")
    texts = [text for reference in (*parents, *links) for text in (reference.role, reference.path, reference.hash)]
    texts += [*trust, *(file.sha256 for file in files.values())]
    if not all(isinstance(text, str) and "\0" not in text and len(text) <= PATH for text in texts):
        raise ValueError("a part of it is no text, or longer than any path")
    unit = Unit(**(stored.get("unit") or {}))
    if not (isinstance(unit.factor, int | float) and isinstance(unit.name, str)):
        raise ValueError("its unit is none")
    made = datetime.fromisoformat(stored["created"])
    if made.tzinfo is None or not FIRST <= made.year <= LAST:
        raise ValueError("it was made at no moment")
    if not abs(stored["duration"]) < LONGEST:
        raise ValueError("its duration is none")
    for name in (*files, stored.get("metrics", Manifest.metrics)):
        if Path(name).is_absolute() or ".." in Path(name).parts or "\0" in name:
            raise ValueError(f"{name} is no file of the artifact")
    if not all(isinstance(file.bytes, int) for file in files.values()):
        raise ValueError("a size is no number")
    return Manifest(**stored, files=files, parents=parents, links=links, trust=trust)
