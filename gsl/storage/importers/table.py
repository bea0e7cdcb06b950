"""A table of a foreign log: columns by name, of which only those that are asked for are read."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from gsl.core.budget import COLUMNS
from gsl.errors import TrajectoryError, shorten
from gsl.storage.trajectory_contract import suggestion

SHOWN = 12


class Table(Protocol):
    """One file of a log, or one topic of a bag.

    Attributes:
        path: The file.
        names: Its columns.
        fields: What it says once, such as a JSON document's single values, by name.
        first_line: Where its first row is in a file that has one row a line, counted from 1; else None.
    """

    path: Path
    names: Sequence[str]
    fields: Mapping[str, Any]
    first_line: int | None

    def columns(self, wanted: Sequence[str]) -> dict[str, np.ndarray]:
        """Return columns that are there: numbers, truth values or texts (T,), or several numbers a row (T, n)."""
        ...


def check_columns(path: Path, names: Sequence[str]) -> None:
    """Refuse a table of more columns than any robot logs."""
    if len(names) > COLUMNS:
        raise TrajectoryError(path, f"has {len(names):,} columns; {COLUMNS:,} are read; cut what is no signal")


def missing_column(table: Table, name: str, others: Collection[str] = ()) -> TrajectoryError:
    """Return the error for a column that a table lacks; `others` are named already: they were not meant."""
    shown = ", ".join(map(shorten, table.names[:SHOWN])) + (
        f" and {len(table.names) - SHOWN} more" * (len(table.names) > SHOWN)
    )
    near = suggestion(name, set(table.names) - set(others))
    return TrajectoryError(table.path, f"is missing{near or ''}; the file has {shown or 'no column'}", column=name)


def numbers(path: Path, name: str, values: Sequence[Any]) -> np.ndarray:
    """Return values of one kind as an array: numbers (T,), truth values, texts, or rows of numbers (T, n).

    Raises:
        TrajectoryError: They are of different kinds or lengths, or nested deeper.
    """
    if values and all(isinstance(value, str) for value in values):
        return np.array(values, dtype=object)
    filled = [np.nan if value is None else value for value in values]
    try:
        numbers = np.array(filled)
    except ValueError:
        numbers = np.array(None)
    if numbers.dtype.kind in "buif" and numbers.ndim in (1, 2):
        return numbers
    first = _shape(filled[0]) if filled else None
    for row, value in enumerate(filled):
        shape = _shape(value)
        if isinstance(value, str | dict) or shape is None or shape != first:
            shown = str(value) if len(str(value)) <= 40 else f"{str(value)[:37]}..."
            raise TrajectoryError(path, f"{shown} is not a number, or not as long as the first", column=name, row=row)
    raise TrajectoryError(path, "holds no numbers", column=name)


def _shape(value: Any) -> tuple[int, ...] | None:
    """Return the shape of a number or of nested lists, None where rows are of different lengths."""
    try:
        return np.shape(value) if isinstance(value, list) else ()
    except ValueError:
        return None
