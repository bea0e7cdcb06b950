"""Tensors that torch saved (`.pt`), by key; read without running the pickle they come in, as weights alone."""

from __future__ import annotations

import os
import pickle
import warnings
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from gsl.core.budget import DEPTH, open_file, within
from gsl.errors import TrajectoryError
from gsl.storage.importers.array_table import Shapes
from gsl.storage.importers.sizes import DAMAGED, check_need

_DAMAGED = (RuntimeError, OSError, EOFError, ValueError, KeyError, AttributeError, AssertionError, IndexError)


class TensorArrays:
    """A dictionary of tensors, nested or not, or a single one, which is called `tensor`."""

    def __init__(self, path: Path, memory: float) -> None:
        import torch

        self.path = path
        try:
            with open_file(path) as file, within(f"{path}: reading it", growth=memory), warnings.catch_warnings():
                check_need(path, 2.0 * _measure(file), memory)
                file.seek(0)
                warnings.simplefilter("ignore", UserWarning)  # of pickles of another protocol, which are refused
                saved = torch.load(file, map_location="cpu", weights_only=True)
        except pickle.UnpicklingError as error:
            problem = "holds more than tensors (a pickle, which can run code): none is read; save a dict of tensors"
            raise TrajectoryError(path, problem) from error
        except _DAMAGED as error:
            raise TrajectoryError(path, f"is no file of torch.save, or {DAMAGED}") from error
        leaves = dict(_leaves(saved if isinstance(saved, dict) else {"tensor": saved}))
        dense = {
            name: leaf
            for name, leaf in leaves.items()
            if isinstance(leaf, torch.Tensor)
            and leaf.layout == torch.strided
            and not (leaf.is_quantized or leaf.is_meta)
        }
        self.tensors = {name: tensor.detach() for name, tensor in dense.items()}
        self.shapes: Shapes = {
            name: (tuple(tensor.shape), np.dtype(str(tensor.dtype).removeprefix("torch.")))
            for name, tensor in self.tensors.items()
            if tensor.dtype in _plain()
        }
        self.fields: Mapping[str, Any] = {
            name: leaf for name, leaf in leaves.items() if isinstance(leaf, str | int | float | bool)
        }

    def read(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Return tensors by name."""
        try:
            return {name: np.array(self.tensors[name].numpy()) for name in names}
        except (RuntimeError, TypeError) as error:
            raise TrajectoryError(self.path, f"holds no plain tensors: {str(error).splitlines()[0]}") from error


def _measure(file: IO[bytes]) -> float:
    """Return the bytes of a file, or what it unpacks to if it is an archive."""
    size = float(file.seek(0, os.SEEK_END))
    try:
        with zipfile.ZipFile(file) as archive:
            return max(size, float(sum(entry.file_size for entry in archive.infolist())))
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        return size  # an older file, or damaged, which torch will tell


def _plain() -> set[Any]:
    """Return the types of numbers that numpy has too."""
    import torch

    floats = {torch.float16, torch.float32, torch.float64}
    return floats | {torch.bool, torch.uint8, torch.int8, torch.int16, torch.int32, torch.int64}


def _leaves(value: dict[Any, Any], prefix: str = "", depth: int = 0) -> Iterator[tuple[str, Any]]:
    for name, entry in value.items() if depth < DEPTH else ():
        if isinstance(entry, dict):
            yield from _leaves(entry, f"{prefix}{name}.", depth + 1)
        else:
            yield f"{prefix}{name}", entry
