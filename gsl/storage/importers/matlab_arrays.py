"""Matrices of a MATLAB file (`.mat` to version 7.2), by name; fields of structs by dotted paths."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.budget import DEPTH, within
from gsl.errors import InputError, TrajectoryError
from gsl.storage.importers.array_table import Shapes
from gsl.storage.importers.sizes import DAMAGED, check_need

NUMBER = 8.0  # bytes of one, the most


class MatlabArrays:
    """The arrays of a mat file; a row of numbers is taken for a column."""

    def __init__(self, path: Path, memory: float) -> None:
        from scipy.io import loadmat, whosmat

        self.path = path
        try:
            with within(f"{path}: reading it", growth=memory):
                check_need(
                    path, 3.0 * sum(NUMBER * math.prod(map(float, shape)) for _, shape, _ in whosmat(path)), memory
                )
                saved = loadmat(path, simplify_cells=True)
        except InputError:
            raise
        except Exception as error:  # a damaged file ends the reader in many ways
            raise TrajectoryError(path, f"is no MATLAB file, or {DAMAGED}") from error
        leaves = dict(_leaves({name: value for name, value in saved.items() if not name.startswith("__")}))
        self.arrays = {name: leaf for name, leaf in leaves.items() if isinstance(leaf, np.ndarray) and leaf.ndim}
        self.shapes: Shapes = {name: (array.shape, array.dtype) for name, array in self.arrays.items()}
        self.fields: Mapping[str, Any] = {
            name: leaf for name, leaf in leaves.items() if isinstance(leaf, str | int | float | bool)
        }

    def read(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Return arrays by name."""
        return {name: self.arrays[name] for name in names}


def _leaves(value: dict[str, Any], prefix: str = "", depth: int = 0) -> Iterator[tuple[str, Any]]:
    for name, entry in value.items() if depth < DEPTH else ():
        if isinstance(entry, dict):
            yield from _leaves(entry, f"{prefix}{name}.", depth + 1)
        else:
            yield f"{prefix}{name}", entry.item() if isinstance(entry, np.generic) else entry
