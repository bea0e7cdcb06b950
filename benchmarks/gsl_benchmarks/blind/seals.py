"""Seals: hashes that commit a benchmark to labels nobody has read yet, and answers to what was said without them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gsl.errors import GslError
from gsl.storage.documents import text
from gsl.storage.hashing import file_hash

VERSION = 1


def hash_label(nonce: str, label: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a nonce and a label: it tells nothing of the label, and no other label has it."""
    return hashlib.sha256((nonce + text(label)).encode()).hexdigest()


def nonce_of(secret: str, case: str) -> str:
    """Return the nonce of a case: as random as the secret."""
    return hashlib.sha256(f"nonce\0{secret}\0{case}".encode()).hexdigest()


def files_below(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file of a case by name."""
    return {path.name: file_hash(path) for path in sorted(folder.iterdir()) if path.is_file()}


def check_files(folder: Path, hashes: Mapping[str, str]) -> None:
    """Refuse a case whose files are not those that were sealed."""
    there = files_below(folder) if folder.is_dir() else {}
    for name in sorted({*hashes, *there}):
        if name not in there:
            raise GslError(f"{folder / name}: is missing, though it is sealed; make the benchmark again")
        if there[name] != hashes.get(name):
            raise GslError(f"{folder / name}: the seal does not hold, the file was changed after it was made")


def check_label(place: Path, case: str, seal: str, entry: Mapping[str, Any]) -> None:
    """Refuse a label that is not the one that was sealed."""
    if hash_label(str(entry.get("nonce", "")), entry.get("label", {})) != seal:
        raise GslError(f"{place}: the seal of {case} does not hold, its label or nonce was changed after it was made")


def total(hashes: Mapping[str, str]) -> str:
    """Return one SHA-256 of many by name."""
    return hashlib.sha256(text(dict(hashes)).encode()).hexdigest()
