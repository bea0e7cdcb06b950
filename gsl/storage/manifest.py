"""The manifest of an artifact: what it is, what it was made from, and the hash of every file in it."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gsl.errors import ArtifactError
from gsl.storage import documents
from gsl.storage.hashing import contents_hash, file_hash

SCHEMA_VERSION = 1
NAME = "manifest.json"


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
        metrics: Name of the file that holds the metrics.
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
    metrics: str = "metrics.json"
    unit: Mapping[str, Any] | None = None
    schema_version: int = SCHEMA_VERSION

    @property
    def contents(self) -> str:
        """Hash of the artifact's contents, as its children record it."""
        return contents_hash(self.kind, {name: file.sha256 for name, file in self.files.items()})


def inventory(folder: Path) -> dict[str, File]:
    """Return every file below `folder` but its manifest, by name in it."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file() and path != folder / NAME)
    return {path.relative_to(folder).as_posix(): File(file_hash(path), path.stat().st_size) for path in paths}


def damaged_file(folder: Path, manifest: Manifest) -> str | None:
    """Return the first file that is missing or not what the manifest says, None when the artifact is intact."""
    for name, file in manifest.files.items():
        path = folder / name
        if not path.is_file() or path.stat().st_size != file.bytes or file_hash(path) != file.sha256:
            return name
    return None


def write(folder: Path, manifest: Manifest) -> None:
    """Write the manifest, which declares the artifact complete."""
    documents.write_json(folder / NAME, dataclasses.asdict(manifest))


def read(folder: Path) -> Manifest:
    """Read the manifest of the artifact in `folder`.

    Raises:
        ArtifactError: There is none, or it is foreign or of another version.
    """
    if not folder.exists():
        raise ArtifactError(folder, "does not exist")
    try:
        stored = json.loads((folder / NAME).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError) as error:
        raise ArtifactError(folder, f"is no complete artifact: it holds no {NAME}") from error
    except ValueError as error:
        raise ArtifactError(folder / NAME, "is damaged: it is not JSON; build the artifact again") from error
    version = stored.get("schema_version") if isinstance(stored, dict) else None
    if version != SCHEMA_VERSION:
        raise ArtifactError(folder / NAME, f"schema_version {version!r} is unknown; this gsl reads {SCHEMA_VERSION}")
    try:
        return _parsed(stored)
    except (TypeError, AttributeError, KeyError) as error:
        raise ArtifactError(folder / NAME, "is damaged: its entries do not fit; build the artifact again") from error


def _parsed(stored: dict[str, Any]) -> Manifest:
    files = {name: File(**file) for name, file in stored.pop("files").items()}
    parents = tuple(Parent(**parent) for parent in stored.pop("parents"))
    return Manifest(**stored, files=files, parents=parents)
