"""What is known of an episode: the mapping's texts with the {fields} of its files, path and columns filled in."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from gsl.errors import ConfigError, TrajectoryError
from gsl.storage.importers.mapping import Mapping as LogMapping
from gsl.storage.importers.table import Table

_FIELD = re.compile(r"\{([^{}]+)\}")


def find_label_columns(
    mapping: LogMapping, fields: Mapping[str, Any], tables: Mapping[str, Table]
) -> dict[str, list[str]]:
    """Return for each file the columns that name an episode or say something of it; single values go first."""
    texts = [text for text in (mapping.name, *mapping.about.values()) if isinstance(text, str)]
    asked = dict.fromkeys(field for text in texts for field in _FIELD.findall(text))
    columns: dict[str, list[str]] = {}
    for role, table in tables.items():
        before = {name for names in columns.values() for name in names}
        free = [name for name in asked if name not in fields and name not in before and name != mapping.episode]
        columns[role] = [name for name in free if name in table.names]
    return columns


def constant(table: Table, name: str, values: np.ndarray, rows: np.ndarray) -> Any:
    """Return the one value that a column has in an episode.

    Args:
        table: For errors.
        name: Of the column.
        values: In the rows of the episode, shape (T,).
        rows: Their numbers in the file, shape (T,).

    Raises:
        TrajectoryError: It changes, or is empty.
    """
    first = values[0]
    if np.ndim(first):
        raise TrajectoryError(table.path, "holds lists, which tell nothing of an episode", column=name)
    other = values != first
    if isinstance(first, float | np.floating) and not np.isfinite(first):
        problem = "is no value that tells something of an episode; fill it in"
        raise TrajectoryError(table.path, problem, column=name, row=int(rows[0]))
    if other.any():
        at = int(np.argmax(other))
        problem = f"changes from {first} to {values[at]} within an episode, of which it should tell something"
        raise TrajectoryError(
            table.path, f"{problem}; is it the column of mapping.episode?", column=name, row=int(rows[at])
        )
    return first.item() if isinstance(first, np.generic) else first


def fill(value: Any, fields: Mapping[str, Any], where: str) -> Any:
    """Return a value with its {fields} filled in; one that is a field alone keeps its type.

    Raises:
        ConfigError: There is no such field.
    """
    if not isinstance(value, str):
        return value if isinstance(value, int | float | bool | list | dict) else str(value)
    for field in _FIELD.findall(value):
        if field not in fields:
            there = ", ".join(sorted(fields))
            raise ConfigError(where, f"there is no field or column {field}; there is {there}", given=value)
    alone = _FIELD.fullmatch(value)
    return fields[alone.group(1)] if alone else _FIELD.sub(lambda match: str(fields[match.group(1)]), value)
