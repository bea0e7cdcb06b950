"""What a parquet file declares before it is read: a small file can hold billions of rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gsl.core.budget import COLUMNS
from gsl.errors import TrajectoryError

if TYPE_CHECKING:
    import pyarrow.parquet as pq

MOST = 16e9  # bytes of a trajectory file in memory; hours of a humanoid are some 0.1e9
FEW, PACKED = 0.3e9, 50.0  # bytes in memory that any file may take, and bytes for one of a larger file: logs pack by 10


def count_bytes(metadata: pq.FileMetaData, names: Sequence[str] | None = None) -> float:
    """Return the memory that columns take [bytes], all if `names` is None: 8 a value, or what they unpack to."""
    total = 0.0
    for group in range(metadata.num_row_groups):
        row_group = metadata.row_group(group)
        for index in range(row_group.num_columns):
            column = row_group.column(index)
            if names is None or any(column.path_in_schema.split(".list.")[0] == name for name in names):
                total += max(8.0 * column.num_values, column.total_uncompressed_size)
    return total


def check_declared(path: Path, metadata: pq.FileMetaData) -> None:
    """Refuse a trajectory file that says it holds more than fits into any memory, or than any log of its size."""
    if metadata.num_columns > COLUMNS:
        raise TrajectoryError(path, f"has {metadata.num_columns:,} columns; {COLUMNS:,} are read")
    need = count_bytes(metadata)
    if need > MOST:
        problem = f"declares {metadata.num_rows:,} rows, {need / 1e9:.3g} GB of memory; a log this long has to be cut"
        raise TrajectoryError(path, problem)
    if need > max(FEW, PACKED * (size := path.stat().st_size)):
        problem = (
            f"has {size / 1e6:.3g} MB, which unpack to {need / 1e9:.3g} GB: no log packs so well; collect it again"
        )
        raise TrajectoryError(path, problem)
