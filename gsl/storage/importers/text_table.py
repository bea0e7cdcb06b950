"""Text tables: CSV, semicolon, tab or blank separated, with a header or not, read in pieces."""

from __future__ import annotations

import csv
import json
import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from gsl.core.budget import find_repeat
from gsl.errors import TrajectoryError
from gsl.storage.importers.sizes import LONGEST_LINE, check_need, open_log
from gsl.storage.importers.table import check_columns, numbers

if TYPE_CHECKING:
    import pandas as pd

CELLS = 2_000_000  # read at once
FACTOR = 100.0  # bytes of text that may be read for one of memory: only the wanted columns stay
BLANKS = r"\s+"
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
_OPEN_QUOTE = re.compile(r"EOF inside string starting at row (\d+)")
_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?|nan|")


class TextTable:
    """A text file with one row a line; columns without a header are called 0, 1, 2, ..."""

    def __init__(self, path: Path, memory: float) -> None:
        self.path, self.memory = path, memory
        self.fields: Mapping[str, Any] = {}
        with open_log(path, most=FACTOR * memory, lines=True) as file:
            first, second = _first_lines(path, file)
        self.separator = _separator(first)
        cells = _cells(path, first.lstrip("#% "), self.separator)
        self.header = not all(_NUMBER.fullmatch(cell.lower()) for cell in cells)
        self.first_line: int | None = 1 + int(self.header)
        self.names: Sequence[str] = cells if self.header else [str(index) for index in range(len(cells))]
        values = _cells(path, second if self.header else first, self.separator)
        self.decimal = "," if self.separator != "," and any(map(_DECIMAL_COMMA.fullmatch, values)) else "."
        check_columns(path, self.names)
        if (name := find_repeat(self.names)) is not None:
            raise TrajectoryError(path, "there are several columns of this name; keep one", column=name)

    def columns(self, wanted: Sequence[str]) -> dict[str, np.ndarray]:
        """Return the wanted columns, read in pieces."""
        pieces: dict[str, list[np.ndarray]] = {name: [] for name in wanted}
        rows = 0
        for piece in self._pieces(wanted):
            for name in wanted:
                pieces[name].append(_values(self.path, name, piece[name], rows))
            rows += len(piece)
            kept = sum(part.nbytes for parts in pieces.values() for part in parts)
            check_need(self.path, 2.0 * kept, self.memory)
        if not rows:
            raise TrajectoryError(self.path, "has no rows; log it again")
        return {name: _join(self.path, name, parts) for name, parts in pieces.items()}

    def _pieces(self, wanted: Sequence[str]) -> Any:
        import pandas as pd

        # without usecols, with which pandas takes rows of any length
        options = {"chunksize": max(1000, CELLS // len(self.names)), "decimal": self.decimal, "header": None}
        options |= {"names": self.names, "skiprows": int(self.header), "index_col": False, "low_memory": False}
        with open_log(self.path, most=FACTOR * self.memory, lines=True) as file, warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            try:
                yield from pd.read_csv(file, sep=self.separator, skipinitialspace=True, **options)
            except pd.errors.EmptyDataError:
                return
            except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
                problem = " ".join(str(error).split()).removeprefix("Error tokenizing data. C error: ")
                if quote := _OPEN_QUOTE.fullmatch(problem):
                    row = int(quote[1]) - int(self.header)
                    raise TrajectoryError(self.path, "has a quote that does not end", row=row) from error
                raise TrajectoryError(self.path, f"has rows of another length than its header: {problem}") from error
            except UnicodeDecodeError as error:
                raise TrajectoryError(self.path, "is no text; which format is it?") from error


def _first_lines(path: Path, file: IO[bytes]) -> tuple[str, str]:
    """Return the first two lines of a file, whose lines may end as those of old Macintoshes do, with CR alone."""
    first = _text(path, file.readline(LONGEST_LINE))
    if "\r" in first:
        lines = first.split("\r", 2)
        return lines[0], lines[1]
    return first, _text(path, file.readline(LONGEST_LINE))


def _text(path: Path, line: bytes) -> str:
    try:
        return line.decode("utf-8-sig").strip("\r\n")
    except UnicodeDecodeError as error:
        raise TrajectoryError(path, "is no text in UTF-8; export it again, or rename it after its format") from error


def _separator(line: str) -> str:
    counts = {mark: line.count(mark) for mark in (";", "\t", ",")}
    best = max(counts, key=lambda mark: counts[mark])
    return best if counts[best] else BLANKS


def _cells(path: Path, line: str, separator: str) -> list[str]:
    if separator == BLANKS:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    except csv.Error as error:  # such as a cell of more than 131,072 letters
        raise TrajectoryError(path, f"its first lines cannot be taken apart: {error}; export it again") from error


def _values(path: Path, name: str, column: pd.Series, first: int) -> np.ndarray:
    """Return a column of a piece whose first row is number `first`."""
    if column.dtype.kind in "buif":
        return column.to_numpy()
    cells = [cell.strip() if isinstance(cell, str) else "" for cell in column]
    if cells and cells[0].startswith("["):
        return _vectors(path, name, cells, first)
    words = {"true": 1.0, "false": 0.0, "": np.nan}
    lines = []
    for row, cell in enumerate(cells):
        value = words.get(cell.lower())
        try:
            lines.append(float(cell) if value is None else value)
        except ValueError:
            if row == 0 and all(cells):
                return np.array(cells, dtype=object)
            raise TrajectoryError(path, f"{cell[:20]!r} is not a number", column=name, row=first + row) from None
    return np.array(lines)


def _vectors(path: Path, name: str, cells: list[str], first: int) -> np.ndarray:
    try:
        return numbers(path, name, json.loads(f"[{','.join(cells)}]"))
    except ValueError as error:
        row = next((row for row, cell in enumerate(cells) if not (cell.startswith("[") and cell.endswith("]"))), 0)
        raise TrajectoryError(path, "is no list of numbers", column=name, row=first + row) from error


def _join(path: Path, name: str, parts: list[np.ndarray]) -> np.ndarray:
    try:
        return np.concatenate(parts)
    except ValueError as error:
        raise TrajectoryError(path, "its lists are not all of one length", column=name) from error
