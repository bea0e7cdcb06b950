"""JSON documents: strict, stable, written whole."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.budget import read_json
from gsl.errors import ArtifactError
from gsl.storage.whole import replacing

_NUMBERS = re.compile(r"\[\n *(?:(?:-?[0-9][0-9.eE+-]*|null),?\n *)+\]")  # no string of JSON holds a bare line end


def plain(value: Any, *, strict: bool = False) -> Any:
    """Return `value` in the types of JSON: arrays become lists, paths text, numbers those of Python.

    Args:
        value: Of any depth.
        strict: Whether a number that is not finite becomes null.
    """
    match value:
        case Mapping():
            return {str(key): plain(entry, strict=strict) for key, entry in value.items()}
        case list() | tuple():
            return [plain(entry, strict=strict) for entry in value]
        case np.ndarray() | np.generic():
            return plain(value.tolist(), strict=strict)
        case Path():
            return value.as_posix()
        case float() if strict and not math.isfinite(value):
            return None
        case _:
            return value


def text(value: Any, *, indent: int | None = None) -> str:
    """Return strict JSON with sorted keys: equal values give equal text."""
    return json.dumps(plain(value, strict=True), sort_keys=True, ensure_ascii=False, allow_nan=False, indent=indent)


def write_json(path: Path, value: Any) -> None:
    """Write `value` as a JSON file a person can read, numbers of a list on one line, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(pretty(value), encoding="utf-8")


def pretty(value: Any) -> str:
    """Return `value` as JSON a person can read, numbers of a list on one line."""
    return _NUMBERS.sub(_on_one_line, text(value, indent=2)) + "\n"


def read_versioned(path: Path, version: int, damaged: str) -> dict[str, Any]:
    """Return a document that has this `schema_version`; `damaged` says what is wrong with one that is no JSON.

    Raises:
        ArtifactError: There is none, or it is damaged or of another version.
    """
    try:
        stored = read_json(path)
    except FileNotFoundError as error:
        raise ArtifactError(path, "does not exist") from error
    except (ValueError, OSError) as error:
        raise ArtifactError(path, damaged) from error
    stored_version = stored.get("schema_version") if isinstance(stored, dict) else None
    if stored_version != version:
        raise ArtifactError(path, f"schema_version {stored_version!r} is unknown; this gsl reads {version}")
    return dict(stored)


@contextmanager
def as_written(path: Path, advice: str) -> Iterator[None]:
    """Within, entries of documents are taken for what they should be; one that is missing or of another kind is damage.

    Raises:
        ArtifactError: It says where, and the `advice`.
    """
    try:
        yield
    except (OSError, LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        problem = f"lacks a part, or is damaged ({type(error).__name__}: {error})"
        raise ArtifactError(path, f"{problem}; {advice}") from error


def _on_one_line(numbers: re.Match[str]) -> str:
    return f"[{', '.join(numbers[0][1:-1].replace(',', ' ').split())}]"
