"""Numpy archives: arrays by key, whose declared sizes are checked before one is read; pickled objects are not."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy

from gsl.core.budget import HEADER_BYTES
from gsl.errors import TrajectoryError
from gsl.storage.importers.sizes import check_need
from gsl.storage.importers.table import missing_column

_DAMAGED = (OSError, EOFError, zipfile.BadZipFile, zlib.error, struct.error)


class ArrayTable:
    """An npz file; arrays of one value are what it says once."""

    first_line: int | None = None

    def __init__(self, path: Path, memory: float) -> None:
        self.path, self.memory = path, memory
        try:
            with zipfile.ZipFile(path) as archive:
                members = [info for info in archive.infolist() if info.filename.endswith(".npy")]
                self.shapes = {info.filename.removesuffix(".npy"): _header(archive, info, path) for info in members}
        except (*_DAMAGED, RuntimeError) as error:  # the last: encrypted, or packed in a way unknown
            raise TrajectoryError(path, "is no npz archive, or truncated or damaged; copy it again") from error
        self.names: Sequence[str] = [name for name, (shape, _) in self.shapes.items() if shape]
        single = [name for name, (shape, kind) in self.shapes.items() if not shape and not kind.hasobject]
        self.fields: Mapping[str, Any] = {name: value.item() for name, value in self._read(single).items()}

    def columns(self, wanted: Sequence[str]) -> dict[str, np.ndarray]:
        """Return the wanted arrays."""
        for name in wanted:
            if name not in self.names:
                raise missing_column(self, name)
            shape, kind = self.shapes[name]
            if kind.hasobject:
                problem = "holds Python objects (a pickle, which can run code): none is read; save plain numbers"
                raise TrajectoryError(self.path, problem, column=name)
            if kind.kind not in "buif" or len(shape) > 2:
                raise TrajectoryError(
                    self.path, f"is of type {kind} and shape {shape}, no rows of numbers", column=name
                )
        return self._read(wanted)

    def _read(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        sizes = [float(np.prod(shape, dtype=float)) * kind.itemsize for shape, kind in map(self.shapes.get, names)]  # type: ignore[misc]
        check_need(self.path, 3.0 * sum(sizes), self.memory)
        try:
            with np.load(self.path, allow_pickle=False) as archive:
                return {name: archive[name] for name in names}
        except (*_DAMAGED, ValueError, KeyError) as error:
            raise TrajectoryError(self.path, f"is damaged: {error}; copy it again") from error


def _header(archive: zipfile.ZipFile, info: zipfile.ZipInfo, path: Path) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Return the shape and type that an array declares."""
    try:
        with archive.open(info) as file:
            return _read_header(file)  # type: ignore[arg-type]
    except (ValueError, SyntaxError, TypeError, EOFError, zlib.error, MemoryError, RecursionError) as error:
        raise TrajectoryError(path, "is no numpy array; save it with numpy.savez", column=info.filename) from error


def _read_header(file: BinaryIO) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = npy.read_magic(file)
    size = file.read(2 if version == (1, 0) else 4)  # of the header, which is read at once, however long it says it is
    if int.from_bytes(size, "little") > HEADER_BYTES:
        raise ValueError(f"its header has {int.from_bytes(size, 'little'):,} bytes")
    rest = io.BytesIO(size + file.read(int.from_bytes(size, "little")))
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, kind = read(rest)
    return shape, kind
