"""Trajectory files: a batch of episodes as one parquet table, one row a control step."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gsl.core.budget import ARTIFACT_BYTES, open_file, parse_json
from gsl.core.trajectory import Batch
from gsl.errors import TrajectoryError
from gsl.storage import documents
from gsl.storage.parquet import check_declared
from gsl.storage.references import resolve
from gsl.storage.trajectory_columns import batch_of, columns_of, metadata_of
from gsl.storage.trajectory_contract import BOOLEANS, INTEGERS, check_metadata, check_names, check_rows
from gsl.storage.whole import replacing

if TYPE_CHECKING:
    import pyarrow as pa

DATA = "trajectories.parquet"
METADATA_KEY = b"gsl"


def data_file(reference: str, side: str = "") -> Path:
    """Return the trajectory file that a path, an artifact of `collect` or `import`, or a run's name stands for.

    Of a run that has collected on both sides, `real` or `sim` says which.
    """
    artifact = resolve(reference, kind=("collect", "import"), side=side)
    return artifact / DATA if artifact.is_dir() else artifact


def write(path: Path, batch: Batch) -> None:
    """Write a batch in float64, whole or not at all; the same batch gives the same bytes.

    Raises:
        TrajectoryError: The batch breaks the contract, so that no reader would take the file.
        GslError: The folder is full or cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not batch.episodes:
        raise TrajectoryError(path, "there is no episode to write")
    columns = columns_of(path, batch)
    metadata = metadata_of(batch, columns)
    check_metadata(path, metadata, None)
    check_names(path, list(columns), metadata)
    check_rows(path, columns)
    table = pa.table(columns).replace_schema_metadata({METADATA_KEY: documents.text(metadata).encode()})
    encodings = {name: "BYTE_STREAM_SPLIT" for name, values in columns.items() if values.dtype.kind == "f"}
    with replacing(path) as temporary:
        pq.write_table(
            table,
            temporary,
            compression="zstd",
            compression_level=1,
            use_dictionary=list(INTEGERS),
            column_encoding=encodings,
            write_page_checksum=True,
        )


def read(path: Path, *, joints: tuple[str, ...] | None = None) -> Batch:
    """Read a batch and check it against the contract.

    Args:
        path: Parquet file.
        joints: All joints that the caller's robot has; a file with another joint is refused.

    Raises:
        TrajectoryError: Names the file, the column and the row (counted from 0) that break the contract.
    """
    table = _table(path)
    metadata = _read_metadata(path, table)
    check_metadata(path, metadata, joints)
    check_names(path, table.column_names, metadata)
    columns = {field.name: _values(path, table, field) for field in table.schema}
    return batch_of(columns, metadata, check_rows(path, columns))


def suggest_import(path: Path) -> str:
    """Return what to type to make a trajectory file of foreign logs."""
    return f"gsl import source={path} mapping=... (docs/howto/own-logs.md)"


def _table(path: Path) -> pa.Table:
    import pyarrow as pa
    import pyarrow.parquet as pq

    if path.is_dir():
        raise TrajectoryError(path, "is a folder; give the parquet file in it")
    if not path.exists():
        raise TrajectoryError(path, "does not exist")
    try:
        with open_file(path, ARTIFACT_BYTES) as source, pq.ParquetFile(source, page_checksum_verification=True) as file:
            check_declared(path, file.metadata)
            return file.read()
    except (pa.ArrowException, OSError) as error:
        problem = "is not a parquet file, or truncated or damaged; copy or collect it again"
        if path.suffix != ".parquet":
            problem = f"is no trajectory file; make one of a log first: {suggest_import(path)}"
        raise TrajectoryError(path, problem) from error


def _read_metadata(path: Path, table: pa.Table) -> Any:
    stored = (table.schema.metadata or {}).get(METADATA_KEY)
    if stored is None:
        raise TrajectoryError(
            path, "has no metadata under the key `gsl`; it is no trajectory file; see docs/reference/files.md"
        )
    try:
        return parse_json(stored)
    except ValueError as error:
        raise TrajectoryError(path, "the metadata key `gsl` is not JSON; write the file with gsl") from error


def _values(path: Path, table: pa.Table, field: pa.Field) -> np.ndarray:
    import pyarrow as pa

    expected, fits = _expect(field.name, pa.types)
    if not fits(field.type):
        raise TrajectoryError(path, f"is of type {field.type}, not {expected}; convert it", column=field.name)
    column = table.column(field.name)
    if pa.types.is_floating(field.type):
        return np.asarray(column.to_numpy(), dtype=np.float64)
    if column.null_count:
        row = int(np.argmax(column.is_null().to_numpy()))
        raise TrajectoryError(path, "is empty; drop or mend the row", column=field.name, row=row)
    return np.asarray(column.to_numpy())


def _expect(name: str, types: Any) -> tuple[str, Callable[[Any], bool]]:
    if name in INTEGERS:
        return "int32", types.is_integer
    if name in BOOLEANS:
        return "bool", types.is_boolean
    return "float64 or float32", lambda kind: types.is_float32(kind) or types.is_float64(kind)
