"""Parquet tables of any schema; lists of numbers are rows of several values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gsl.core.budget import open_file
from gsl.errors import TrajectoryError
from gsl.storage.importers.sizes import DAMAGED, check_need
from gsl.storage.importers.table import numbers
from gsl.storage.parquet import count_bytes

if TYPE_CHECKING:
    import pyarrow as pa

OBJECTS = 12.0  # bytes of memory for one of texts or lists, which become objects of Python


class ParquetTable:
    """A parquet file."""

    first_line: int | None = None

    def __init__(self, path: Path, memory: float) -> None:
        self.path, self.memory = path, memory
        self.fields: Mapping[str, Any] = {}
        self.names: Sequence[str] = names_of(path)

    def columns(self, wanted: Sequence[str]) -> dict[str, np.ndarray]:
        """Return the wanted columns."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            with open_file(self.path) as source, pq.ParquetFile(source) as file:
                simple = [field.name for field in file.schema_arrow if pa.types.is_primitive(field.type)]
                simple = [name for name in simple if name in wanted]
                nested = [name for name in wanted if name not in simple]
                need = 2.0 * count_bytes(file.metadata, simple) + OBJECTS * count_bytes(file.metadata, nested)
                check_need(self.path, need, self.memory)
                table = file.read(columns=list(wanted))
        except (pa.ArrowException, OSError) as error:
            raise TrajectoryError(self.path, f"is {DAMAGED}") from error
        if not table.num_rows:
            raise TrajectoryError(self.path, "has no rows; log it again")
        return {name: convert(self.path, name, table.column(name)) for name in wanted}


def names_of(path: Path) -> list[str]:
    """Return the columns of a file.

    Raises:
        TrajectoryError: It is no parquet file, or damaged.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with open_file(path) as source:
            return list(pq.read_schema(source).names)
    except (pa.ArrowException, OSError) as error:
        raise TrajectoryError(path, f"is not a parquet file, or {DAMAGED}") from error


def convert(path: Path, name: str, column: pa.ChunkedArray) -> np.ndarray:
    """Return a column's numbers, truth values, stamps or texts (T,), or its lists of numbers (T, n)."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind):
        return np.asarray(column.to_numpy())
    if pa.types.is_timestamp(kind):
        return np.asarray(column.cast(pa.timestamp("ns")).to_numpy())
    return numbers(path, name, column.to_pylist())
