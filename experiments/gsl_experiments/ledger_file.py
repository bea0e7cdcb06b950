"""The file of a study's trials: what stands in it is checked before any of it is believed."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence, Set
from inspect import signature
from pathlib import Path
from typing import Any, Protocol

from pydantic import TypeAdapter, ValidationError

from gsl.errors import ArtifactError
from gsl.storage import documents
from gsl.storage.hashing import file_hash
from gsl.storage.whole import explain_refusal, replacing

RECIPE, MADE_BY = "recipe", "made_by"
SHOWN = 3  # of names that are wrong


class Figures(Protocol):
    """What a row holds besides the trial's recipe and who made it: a named tuple of figures.

    Those with a default came later: a file may lack them.
    """

    @property
    def contradiction(self) -> str:
        """What cannot be, in words; nothing if the figures fit together."""


def read(path: Path, kind: type[Figures]) -> dict[str, list[dict[str, Any]]]:
    """Return the rows of each trial, by recipe.

    Raises:
        ArtifactError: The file holds something else, a trial twice, or figures that cannot be.
    """
    adapter, rows, last = TypeAdapter[Figures](kind), dict[str, list[dict[str, Any]]](), None
    for index, row in enumerate(_parse(path), start=1):
        if problem := _problem(row, adapter, kind):
            raise ArtifactError(path, f"row {index} {problem}")
        if row[RECIPE] in rows and row[RECIPE] != last:
            raise ArtifactError(path, f"row {index} is of a trial that the file has already; leave one of the two out")
        last = row[RECIPE]
        rows.setdefault(last, []).append(row)
    return rows


def write(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write the rows; before that their hash is added to a hidden file beside them, so that a kill harms neither."""
    text = documents.pretty(rows)
    with explain_refusal(path.parent), _seal(path).open("a") as seal:
        seal.write(f"{hashlib.sha256(text.encode()).hexdigest()}\n")
        seal.flush()
        os.fsync(seal.fileno())
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def check(path: Path) -> None:
    """Refuse a growing file that is not as a study wrote it; one without a hash, as a copy is, passes."""
    if _seal(path).is_file() and file_hash(path) not in _seal(path).read_text(errors="replace").split():
        advice = "take it away, or give it as known= if it was you who changed it"
        raise ArtifactError(path, f"is not as the study wrote it; {advice}")


def _seal(path: Path) -> Path:
    return path.with_name(f".{path.name}.sha256")


def _parse(path: Path) -> list[dict[str, Any]]:
    try:
        rows = json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_figure)
    except (ValueError, OSError) as error:
        raise ArtifactError(path, f"is no file of a study's results; move it away: {error}") from error
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ArtifactError(path, "is no file of a study's results: not a list of rows")
    return rows


def _problem(row: Mapping[str, Any], adapter: TypeAdapter[Figures], kind: type[Figures]) -> str:
    parameters = signature(kind).parameters.values()
    fields = [
        parameter.name for parameter in parameters if parameter.name in row or parameter.default is parameter.empty
    ]
    due = {*fields, RECIPE, MADE_BY}
    if wrong := [
        f"{_few(names)} {how}" for names, how in ((due - row.keys(), "lacking"), (row.keys() - due, "unknown")) if names
    ]:
        return f"is no result of such a study: {', '.join(wrong)}"
    if odd := [name for name in (RECIPE, MADE_BY) if not isinstance(row[name], str)]:
        return f"has {odd[0]} {row[odd[0]]!r}: that has to be text"
    try:
        figures = adapter.validate_python({name: row[name] for name in fields}, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        return f"has {where} {first['input']!r}: {first['msg'].lower()}"
    return f"contradicts itself: {figures.contradiction}" if figures.contradiction else ""


def _few(names: Set[str]) -> str:
    """Return the first of some names, and how many more there are."""
    shown, more = sorted(names)[:SHOWN], len(names) - SHOWN
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")


def _no_figure(name: str) -> None:
    raise ValueError(f"{name} is no figure")
