"""JSON logs: one document with a list of rows or columns of lists, or one record a line."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gsl.errors import TrajectoryError
from gsl.storage.importers.sizes import check_need, open_log
from gsl.storage.importers.table import numbers

FACTOR = 10.0  # bytes of memory that a byte of a document takes while it is read
LINES = (".jsonl", ".ndjson")


class JsonTable:
    """A list of records, or named lists; columns are dotted paths such as `state.position`."""

    def __init__(self, path: Path, records: str, memory: float) -> None:
        self.path, self.records, self.memory = path, records, memory
        self.lines = path.name.removesuffix(".gz").endswith(LINES)
        self.first_line: int | None = 1 if self.lines else None
        document = [] if self.lines else _document(path, memory)
        place = document if self.lines or not records else _at(document, records)
        if place is None and not self.lines:
            near = ", ".join(_flat(document)) if isinstance(document, dict) else "a list"
            raise TrajectoryError(path, f"has no records at {records}; it holds {near}")
        self.rows = place if isinstance(place, list) else None
        self.fields: Mapping[str, Any] = _fields(document)
        first = next(iter(_records(path, memory)), None) if self.lines else place
        if isinstance(first, list):
            first = first[0] if first else None
        if not isinstance(first, dict):
            raise TrajectoryError(path, "has no rows of named values; say in the mapping where they are: records=...")
        self.names: Sequence[str] = [
            name for name, value in _flat(first).items() if self.rows or self.lines or isinstance(value, list)
        ]
        self.place = place

    def columns(self, wanted: Sequence[str]) -> dict[str, np.ndarray]:
        """Return the wanted columns."""
        if self.rows is None and not self.lines:
            return {name: numbers(self.path, name, _at(self.place, name)) for name in wanted}
        columns: dict[str, list[Any]] = {name: [] for name in wanted}
        for row, record in enumerate(_records(self.path, self.memory) if self.lines else self.rows or []):
            for name, values in columns.items():
                value = _at(record, name)
                if value is None and name not in _flat(record):
                    raise TrajectoryError(self.path, "is missing here", column=name, row=row)
                values.append(value)
            if row % 10_000 == 0:
                check_need(self.path, 50.0 * row * len(columns), self.memory)
        return {name: numbers(self.path, name, values) for name, values in columns.items()}


def _document(path: Path, memory: float) -> Any:
    check_need(path, FACTOR * path.stat().st_size, memory)
    with open_log(path, most=memory / FACTOR) as file:
        return _parse(path, file.read(), None)


def _records(path: Path, memory: float) -> Iterator[Any]:
    with open_log(path, most=100.0 * memory, lines=True) as file:
        for number, line in enumerate(file, 1):
            if line.strip():
                yield _parse(path, line, number - 1)


def _parse(path: Path, text: bytes, row: int | None) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        where = "not text, or too deep"
        if isinstance(error, json.JSONDecodeError):
            where = f"line {error.lineno}: {error.msg}" if row is None else error.msg
        more = "; one record a line is a .jsonl" if "Extra data" in where else ""
        if row is None and not text.rstrip().endswith((b"]", b"}")):
            more = "; it is cut off, as that of a killed logger is: copy it again, or log a record a line (.jsonl)"
        raise TrajectoryError(path, f"is not JSON ({where}){more}", row=row) from error


def _at(value: Any, name: str) -> Any:
    """Return what is at a dotted path; a key that has dots in it goes first."""
    if isinstance(value, dict) and name in value:
        return value[name]
    for part in name.split("."):
        if not isinstance(value, dict) or part not in value:
            return None
        value = value[part]
    return value


def _flat(value: Any, prefix: str = "") -> dict[str, Any]:
    if not isinstance(value, dict):
        return {prefix: value}
    return {
        key: leaf for name, part in value.items() for key, leaf in _flat(part, f"{prefix}.{name}".lstrip(".")).items()
    }


def _fields(document: Any) -> dict[str, Any]:
    """Return the single values of a document."""
    if not isinstance(document, dict):
        return {}
    return {name: value for name, value in _flat(document).items() if not isinstance(value, list | dict)}
