"""Files of numpy: an npz archive, a single npy of rows, or a folder of npy files; pickled objects are not read."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from tokenize import TokenError
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy

from gsl.core.budget import COLUMNS, HEADER_BYTES, open_file
from gsl.errors import TrajectoryError
from gsl.storage.importers.array_table import Shapes
from gsl.storage.importers.sizes import DAMAGED

END = ".npy"
MOST = 2**40  # of a dimension: an array of nothing may be as long as it says, and no memory holds it
_DAMAGED = (OSError, EOFError, zipfile.BadZipFile, zlib.error, struct.error)
_NO_HEADER = (ValueError, SyntaxError, TokenError, TypeError, EOFError, zlib.error, MemoryError, RecursionError)


class NpzArrays:
    """The arrays of an npz archive."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.fields: Mapping[str, Any] = {}
        try:
            with open_file(path) as file, zipfile.ZipFile(file) as archive:
                members = [info for info in archive.infolist() if info.filename.endswith(END)]
                self.shapes: Shapes = {
                    info.filename.removesuffix(END): _header(archive, info, path) for info in members
                }
        except (*_DAMAGED, RuntimeError) as error:  # the last: encrypted, or packed in a way unknown
            raise TrajectoryError(path, f"is no npz archive, or {DAMAGED}") from error

    def read(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Return arrays by name."""
        try:
            with open_file(self.path) as file, np.load(file, allow_pickle=False) as archive:
                return {name: archive[name] for name in names}
        except (*_DAMAGED, ValueError, KeyError) as error:
            raise TrajectoryError(self.path, f"is damaged: {error}; copy it again") from error


class NpyFolder:
    """A folder of npy files, each an array by its name: time.npy, dof_pos.npy."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.fields: Mapping[str, Any] = {}
        self.shapes: Shapes = {file.name.removesuffix(END): _read_shape(file) for file in npy_files(path)}

    def read(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Return arrays by name."""
        return {name: _load(self.path / f"{name}{END}") for name in names}


class NpyColumns:
    """A single npy file: columns called 0, 1, 2, ..., or by the names of a structured type."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.fields: Mapping[str, Any] = {}
        shape, kind = _read_shape(path)
        names = list(kind.names or ())
        if not names and (len(shape) != 2 or shape[1] > COLUMNS):
            raise TrajectoryError(path, f"has the shape {shape}; one npy file is a table of rows and columns")
        parts = {name: kind[name] for name in names} or {str(index): kind for index in range(shape[1])}
        self.shapes: Shapes = {name: (shape[:1], part) for name, part in parts.items()}

    def read(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Return columns by name."""
        values = _load(self.path, mmap="r")  # a column of many needs not all of them in memory
        return {name: np.array(values[name] if values.dtype.names else values[:, int(name)]) for name in names}


def npy_files(folder: Path) -> list[Path]:
    """Return the npy files of a folder, in order."""
    return sorted(file for file in folder.glob(f"*{END}") if file.is_file() and not file.name.startswith("."))


def _read_shape(path: Path) -> tuple[tuple[int, ...], np.dtype[Any]]:
    try:
        with open_file(path) as file:
            return _read_header(file)
    except (OSError, *_NO_HEADER) as error:
        raise TrajectoryError(path, "is no numpy array, or damaged; save it with numpy.save") from error


def _load(path: Path, mmap: Any = None) -> np.ndarray:
    try:
        return np.asarray(np.load(path, mmap_mode=mmap, allow_pickle=False))
    except (*_DAMAGED, ValueError) as error:
        raise TrajectoryError(path, f"is damaged: {error}; copy it again") from error


def _header(archive: zipfile.ZipFile, info: zipfile.ZipInfo, path: Path) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Return the shape and type that an array declares."""
    try:
        with archive.open(info) as file:
            return _read_header(file)  # type: ignore[arg-type]
    except _NO_HEADER as error:
        raise TrajectoryError(path, "is no numpy array; save it with numpy.savez", column=info.filename) from error


def _read_header(file: BinaryIO) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = npy.read_magic(file)
    size = file.read(2 if version == (1, 0) else 4)  # of the header, which is read at once, however long it says it is
    if int.from_bytes(size, "little") > HEADER_BYTES:
        raise ValueError(f"its header has {int.from_bytes(size, 'little'):,} bytes")
    rest = io.BytesIO(size + file.read(int.from_bytes(size, "little")))
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, kind = read(rest)
    if not all(type(length) is int and 0 <= length <= MOST for length in shape):
        raise ValueError(f"no array has the shape {shape}")
    return shape, kind
