"""What the trials of a study came to, written as each ends: a study goes on after a stop, or on another machine."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from gsl.core.described import described
from gsl.core.setting import setting
from gsl.errors import ArtifactError
from gsl.storage.documents import text, write_json
from gsl.storage.identity import WITHOUT_EFFECT
from gsl.storage.references import resolve
from gsl.storage.versions import commit

RECIPE, COMMIT = "recipe", "commit"
DIGITS = 12  # of a recipe's hash
MADE = ("forward_model", "inverse_model", "diagnosis")  # of a grounding: names of what a trial makes itself

Known = Annotated[str | None, setting("figures of trials that the same study has made before, not to be run again")]


def recipe(*parts: Any) -> str:
    """Return the hash of a trial's settings, without those on which no result depends and without gsl's sources."""
    return hashlib.sha256(text(_effective(described(list(parts)))).encode()).hexdigest()[:DIGITS]


def known_parent(role: str, known: str | None) -> dict[str, Path]:
    """Return the file of earlier trials as a parent of the study.

    Raises:
        ArtifactError: There is none, or it is no such file.
    """
    if known is None:
        return {}
    path = resolve(known)
    _read(path)
    return {role: path}


class Ledger:
    """The trials so far: figures by name, one or several rows a trial, each with recipe and commit of gsl."""

    def __init__(self, path: Path, known: str | None, console: Any) -> None:
        self._path, self._console = path, console
        self._known: dict[str, list[dict[str, Any]]] = {}
        self._used = 0
        for row in _read(resolve(known)) if known else ():
            self._known.setdefault(row[RECIPE], []).append(row)
        self._commit = _short(commit())
        self._rows: list[dict[str, Any]] = []

    @property
    def figures(self) -> list[dict[str, Any]]:
        """The rows of all trials so far, without recipe and commit."""
        return [{name: value for name, value in row.items() if name not in (RECIPE, COMMIT)} for row in self._rows]

    def knows(self, key: str) -> bool:
        """Return whether a trial is known, which then is one of this study."""
        if key not in self._known:
            return False
        self._used += 1
        self._write(self._known[key])
        return True

    def add(self, key: str, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write down a trial that has ended."""
        self._write([{**row, RECIPE: key, COMMIT: self._commit} for row in rows])

    def close(self, path: Path) -> str:
        """Write all trials to `path`; return in words who made them."""
        if unused := len(self._known) - self._used:
            self._console.status(f"{unused} of {len(self._known)} known trials are of other settings and were not used")
        write_json(path, self._rows)
        made = Counter({row[RECIPE]: row[COMMIT] for row in self._rows}.values())
        return "Trials by commit: " + ", ".join(f"{name or 'unknown'} ({count})" for name, count in made.items()) + "."

    def _write(self, rows: Sequence[dict[str, Any]]) -> None:
        self._rows += rows
        write_json(self._path, self._rows)


def _effective(told: Any) -> Any:
    if isinstance(told, dict):
        counts = {key: value for key, value in told.items() if key not in WITHOUT_EFFECT}
        return {key: _effective(value) for key, value in counts.items() if not (key in MADE and isinstance(value, str))}
    return [_effective(value) for value in told] if isinstance(told, list) else told


def _read(path: Path) -> list[dict[str, Any]]:
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, OSError) as error:
        raise ArtifactError(path, f"is no file of trials: {error}") from error
    if not isinstance(rows, list) or not all(isinstance(row, dict) and {RECIPE, COMMIT} <= row.keys() for row in rows):
        raise ArtifactError(path, "is no file of trials of `gsl reproduce`: rows need a recipe and a commit")
    return rows


def _short(made: Mapping[str, Any] | None) -> str:
    return "" if made is None else made["commit"][:7] + (" with changes" if made["dirty"] else "")
