"""Content hashes: of files, of what an artifact holds, and of gsl's own sources."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from gsl.core.budget import ARTIFACT_BYTES, open_file

PACKAGE = Path(__file__).parents[1]
SHORT = 12
"""Characters of a hash that are shown."""
LOG = "log.txt"
PAGE = "report.html"
STEPS = "metrics.jsonl"
CIRCUMSTANCES = ("manifest.json", "config.yaml", LOG, PAGE, STEPS)


def file_hash(path: Path) -> str:
    """Return the sha256 of a file's bytes.

    Raises:
        InputError: It is no plain file, or too large.
    """
    with open_file(path, ARTIFACT_BYTES) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def contents_hash(kind: str, hashes: Mapping[str, str]) -> str:
    """Return the hash of an artifact's contents from the hashes of its files by name.

    Manifests, settings, logs, pages and metrics of steps say how and when the contents came about; they do not
    count, so that the same work done again leaves what was built on it valid.
    """
    lines = [f"{name} {sha}" for name, sha in sorted(hashes.items()) if Path(name).name not in CIRCUMSTANCES]
    return hashlib.sha256("\n".join([kind, *lines]).encode()).hexdigest()


def sources_hash(other: Path | None = None) -> str:
    """Return the hash of gsl's sources, which are read once a process, and of another package's Python files.

    Args:
        other: Folder of the package, or a file if it is one.
    """
    digest = _digest_ours().copy()
    if other is not None:
        _digest(digest, other, [other] if other.is_file() else other.rglob("*.py"))
    return digest.hexdigest()


@functools.cache
def _digest_ours() -> Any:
    digest = hashlib.sha256()
    files = (path for path in PACKAGE.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    _digest(digest, PACKAGE, files)
    return digest


def _digest(digest: Any, place: Path, paths: Iterable[Path]) -> None:
    for path in sorted(paths):
        digest.update(f"{path.relative_to(place).as_posix()}\0{path.stat().st_size}\0".encode())
        digest.update(path.read_bytes())
