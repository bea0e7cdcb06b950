"""The formats of foreign logs: which reader takes which file, by the end of its name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gsl.core.budget import check_file
from gsl.errors import InputError, TrajectoryError
from gsl.storage.importers.array_table import ArrayTable
from gsl.storage.importers.bag_table import BagTable
from gsl.storage.importers.hdf5_arrays import Hdf5Arrays, is_hdf5
from gsl.storage.importers.json_table import LINES, JsonTable
from gsl.storage.importers.matlab_arrays import MatlabArrays
from gsl.storage.importers.numpy_arrays import END as NPY
from gsl.storage.importers.numpy_arrays import NpyColumns, NpyFolder, NpzArrays, npy_files
from gsl.storage.importers.parquet_table import ParquetTable
from gsl.storage.importers.table import Table, check_columns
from gsl.storage.importers.tensor_arrays import TensorArrays
from gsl.storage.importers.text_table import TextTable
from gsl.storage.lerobot.dataset import Entry
from gsl.storage.lerobot.episode_table import EpisodeTable

TEXT, DOCUMENTS, BAGS = (".csv", ".tsv", ".txt"), (".json", *LINES), (".mcap", ".db3", ".bag")
PACKED = tuple(f"{end}.gz" for end in (*TEXT, *DOCUMENTS))
HDF5, TENSORS, MATLAB = (".hdf5", ".h5"), (".pt", ".pth"), ".mat"
ENDS = (*TEXT, *DOCUMENTS, *PACKED, ".npz", NPY, ".parquet", *HDF5, MATLAB, *TENSORS, *BAGS)


def table(path: Path, *, topic: str, records: str, memory: float, entry: Entry | None = None) -> Table:
    """Return the table in a file, of which nothing but names is read yet.

    Args:
        path: A file, or the folder of a bag or of npy files.
        topic: Of a bag.
        records: Of a JSON document: path of its list of rows; of an HDF5 file: its group.
        memory: That reading it may take [bytes].
        entry: Of a LeRobot data set, if the file is one of its.

    Raises:
        InputError: The format is unknown, or the file is empty, damaged or too large.
    """
    if entry is not None:
        return EpisodeTable(entry, memory)
    for file in [path] if not path.is_dir() else path.iterdir():
        if not file.is_dir():
            check_file(file)  # before anything opens it
    if is_bag(path):
        return BagTable(path, topic, memory)
    if path.is_dir():
        return ArrayTable(path, NpyFolder(path), memory)
    if not path.stat().st_size:
        raise TrajectoryError(path, "is empty; log it again")
    table = _reader(path, records, memory)()
    check_columns(path, table.names)
    return table


def _reader(path: Path, records: str, memory: float) -> Callable[[], Table]:
    end = "".join(path.suffixes[-2:]) if path.suffix == ".gz" else path.suffix
    if end.removesuffix(".gz") in DOCUMENTS:
        return lambda: JsonTable(path, records, memory)
    if end.removesuffix(".gz") in TEXT:
        return lambda: TextTable(path, memory)
    if end == ".npz":
        return lambda: ArrayTable(path, NpzArrays(path), memory)
    if end == NPY:
        return lambda: ArrayTable(path, NpyColumns(path), memory)
    if end in TENSORS:
        return lambda: ArrayTable(path, TensorArrays(path, memory), memory)
    if end in HDF5 or (end == MATLAB and is_hdf5(path)):
        return lambda: ArrayTable(path, Hdf5Arrays(path, records, turned=end == MATLAB), memory)
    if end == MATLAB:
        return lambda: ArrayTable(path, MatlabArrays(path, memory), memory)
    if end == ".parquet":
        return lambda: ParquetTable(path, memory)
    raise InputError(f"{path}: {end or 'no suffix'} is no format that is read; there is {', '.join(ENDS)}")


def readable(path: Path) -> bool:
    """Tell whether a file's name, or the folder of a bag or of npy files, is one that is read."""
    return is_bag(path) or is_npy_folder(path) or (path.is_file() and path.name.endswith(ENDS))


def is_npy_folder(path: Path) -> bool:
    """Tell whether a folder holds arrays of one episode, a file each: time.npy, dof_pos.npy."""
    return path.is_dir() and len(npy_files(path)) > 1


def is_bag(path: Path) -> bool:
    """Tell whether a path is a bag: a file, or a folder with its metadata."""
    return path.suffix in BAGS or (path / "metadata.yaml").is_file()


def stem(name: str) -> str:
    """Return a file's name without the end that tells its format."""
    return next((name.removesuffix(end) for end in sorted(ENDS, key=len, reverse=True) if name.endswith(end)), name)
