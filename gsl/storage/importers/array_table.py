"""Arrays by name, one row a step: what an npz, npy, HDF5, mat or tensor file comes down to."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from gsl.errors import TrajectoryError
from gsl.storage.importers.sizes import check_need

Shapes = Mapping[str, tuple[tuple[int, ...], np.dtype[Any]]]


class Arrays(Protocol):
    """Named arrays in a file, whose declared sizes are known before one is read.

    Attributes:
        shapes: Shape and type, by name.
        fields: What the file says once, beside its arrays.
    """

    shapes: Shapes
    fields: Mapping[str, Any]

    def read(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Return arrays by name; only those that hold plain numbers are asked for."""
        ...


class ArrayTable:
    """Arrays of one row a step; those of one value are what the file says once."""

    first_line: int | None = None

    def __init__(self, path: Path, arrays: Arrays, memory: float) -> None:
        self.path, self.arrays, self.memory = path, arrays, memory
        self.names: Sequence[str] = [name for name, (shape, _) in arrays.shapes.items() if shape]
        single = [name for name, (shape, kind) in arrays.shapes.items() if not shape and kind.kind in "buifUS"]
        self.fields: Mapping[str, Any] = {
            **arrays.fields,
            **{name: value.item() for name, value in self._read(single).items()},
        }

    def columns(self, wanted: Sequence[str]) -> dict[str, np.ndarray]:
        """Return the wanted arrays."""
        for name in wanted:
            shape, kind = self.arrays.shapes[name]
            if kind.hasobject:
                problem = "holds Python objects (a pickle, which can run code): none is read; save plain numbers"
                raise TrajectoryError(self.path, problem, column=name)
            if kind.kind not in "buif" or len(shape) > 2:
                raise TrajectoryError(
                    self.path, f"is of type {kind} and shape {shape}, no rows of numbers", column=name
                )
        return self._read(wanted)

    def _read(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        declared = [self.arrays.shapes[name] for name in names]
        sizes = [math.prod(map(_float, shape)) * kind.itemsize for shape, kind in declared]
        check_need(self.path, 3.0 * sum(sizes), self.memory)
        return self.arrays.read(names)


def _float(count: int) -> float:
    return float(count) if count < 1e300 else math.inf
