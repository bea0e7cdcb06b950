"""The formats of foreign logs: which reader takes which file, by the end of its name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gsl.errors import InputError, TrajectoryError
from gsl.storage.importers.array_table import ArrayTable
from gsl.storage.importers.bag_table import BagTable
from gsl.storage.importers.json_table import LINES, JsonTable
from gsl.storage.importers.parquet_table import ParquetTable
from gsl.storage.importers.table import Table, check_columns
from gsl.storage.importers.text_table import TextTable
from gsl.storage.lerobot.dataset import Entry
from gsl.storage.lerobot.episode_table import EpisodeTable

TEXT, DOCUMENTS, BAGS = (".csv", ".tsv", ".txt"), (".json", *LINES), (".mcap", ".db3", ".bag")
PACKED = tuple(f"{end}.gz" for end in (*TEXT, *DOCUMENTS))
ENDS = (*TEXT, *DOCUMENTS, *PACKED, ".npz", ".parquet", *BAGS)


def table(path: Path, *, topic: str, records: str, memory: float, entry: Entry | None = None) -> Table:
    """Return the table in a file, of which nothing but names is read yet.

    Args:
        path: A file, or the folder of a bag.
        topic: Of a bag.
        records: Of a JSON document: path of its list of rows.
        memory: That reading it may take [bytes].
        entry: Of a LeRobot data set, if the file is one of its.

    Raises:
        InputError: The format is unknown, or the file is empty, damaged or too large.
    """
    if entry is not None:
        return EpisodeTable(entry, memory)
    if is_bag(path):
        return BagTable(path, topic, memory)
    if not path.stat().st_size:
        raise TrajectoryError(path, "is empty; log it again")
    found = _reader(path, records, memory)()
    check_columns(path, found.names)
    return found


def _reader(path: Path, records: str, memory: float) -> Callable[[], Table]:
    end = "".join(path.suffixes[-2:]) if path.suffix == ".gz" else path.suffix
    if end.removesuffix(".gz") in DOCUMENTS:
        return lambda: JsonTable(path, records, memory)
    if end.removesuffix(".gz") in TEXT:
        return lambda: TextTable(path, memory)
    if end == ".npz":
        return lambda: ArrayTable(path, memory)
    if end == ".parquet":
        return lambda: ParquetTable(path, memory)
    raise InputError(f"{path}: {end or 'no suffix'} is no format that is read; there is {', '.join(ENDS)}")


def readable(path: Path) -> bool:
    """Tell whether a file's name, or a bag's folder, is one that is read."""
    return is_bag(path) or (path.is_file() and path.name.endswith(ENDS))


def is_bag(path: Path) -> bool:
    """Tell whether a path is a bag: a file, or a folder with its metadata."""
    return path.suffix in BAGS or (path / "metadata.yaml").is_file()


def stem(name: str) -> str:
    """Return a file's name without the end that tells its format."""
    return next((name.removesuffix(end) for end in sorted(ENDS, key=len, reverse=True) if name.endswith(end)), name)
