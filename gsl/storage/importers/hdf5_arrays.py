"""Arrays of an HDF5 file (ALOHA, robomimic, MATLAB 7.3), by their path below a group; links are not followed."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.budget import COLUMNS, DEPTH, check_file, open_file, within
from gsl.errors import InputError, TrajectoryError
from gsl.storage.importers.array_table import Shapes
from gsl.storage.importers.sizes import DAMAGED

MAGIC = b"\x89HDF\r\n\x1a\n"
CHUNK = 256_000_000  # bytes of what is unpacked at once; common ones have one million
MATLAB_HEADER = 512  # bytes before the magic in a mat file of version 7.3


def is_hdf5(path: Path) -> bool:
    """Tell whether a file is one of HDF5, by its first bytes, or by those after a header of MATLAB's."""
    with open_file(path) as file:
        start = file.read(MATLAB_HEADER + len(MAGIC))
    return start.startswith(MAGIC) or start.endswith(MAGIC)


def list_groups(path: Path, pattern: str) -> list[str]:
    """Return the groups whose path fits a pattern such as data/demo_*, in the order of their numbers."""
    parts = pattern.strip("/").split("/")
    with _open(path) as file, _listing(path):
        paths = [""]
        for part in parts:
            below = [
                (before, name) for before in paths for name in _names(file, before) if fnmatch.fnmatchcase(name, part)
            ]
            paths = [f"{before}/{name}".strip("/") for before, name in below]
    if not paths:
        raise TrajectoryError(path, f"has no group {pattern}")
    return sorted(paths, key=lambda name: (len(name), name))


class Hdf5Arrays:
    """The data sets below a group; those of MATLAB are `turned`: its rows are columns here."""

    def __init__(self, path: Path, group: str, *, turned: bool = False) -> None:
        self.path, self.group, self.turned = path, group.strip("/"), turned
        with _open(path) as file, _listing(path):
            root = _at(file, self.group)
            if root is None:
                there = ", ".join(_names(file, "")) or "nothing"
                raise TrajectoryError(path, f"has no group {group}; it has {there}")
            sets = dict(_data_sets(root))
            self.fields: Mapping[str, Any] = dict(_attributes(root))
        self.shapes: Shapes = {name: (_turn(shape) if turned else shape, kind) for name, (shape, kind) in sets.items()}

    def read(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Return arrays by path."""
        with _open(self.path) as file:
            root = _at(file, self.group)
            for name in names:
                if math.prod(root[name].chunks or ()) * root[name].dtype.itemsize > CHUNK:
                    problem = f"is stored in chunks of more than {CHUNK / 1e6:g} MB; store it in smaller ones"
                    raise TrajectoryError(self.path, problem, column=name)
            values = {name: np.asarray(root[name][()]) for name in names}
        return {name: array.T.reshape(_turn(array.shape)) if self.turned else array for name, array in values.items()}


def _turn(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the shape of a matrix of MATLAB as its user sees it, a vector as one number a row."""
    return tuple(size for size in reversed(shape) if size != 1)


@contextmanager
def _open(path: Path) -> Iterator[Any]:
    try:
        import h5py
    except ImportError as error:
        raise InputError(f"{path}: HDF5 files are read with the library h5py: pip install 'gsl[hdf5]'") from error
    try:
        check_file(path)
        file = h5py.File(path, "r")
    except OSError as error:
        raise TrajectoryError(path, f"is no HDF5 file, or {DAMAGED}") from error
    try:
        with file:
            yield file
    except InputError:
        raise
    except Exception as error:  # a damaged file ends the library in many ways
        raise TrajectoryError(path, f"is {DAMAGED}") from error


def _listing(path: Path) -> AbstractContextManager[None]:
    """Bound how long it takes to see what there is: groups that lie in each other twice have endless paths."""
    return within(f"{path}: listing its groups")


def _names(file: Any, group: str) -> list[str]:
    """Return what lies in a group; links to elsewhere are left out: they may lead to other files."""
    import h5py

    place = _at(file, group)
    if not isinstance(place, h5py.Group):
        return []
    return [name for name in place if isinstance(place.get(name, getlink=True), h5py.HardLink)]


def _at(file: Any, group: str) -> Any:
    """Return what is at a path, None if it is not there or behind a link."""
    place = file
    for part in group.split("/") if group else ():
        import h5py

        if not isinstance(place, h5py.Group) or not isinstance(place.get(part, getlink=True), h5py.HardLink):
            return None
        place = place[part]
    return place


def _data_sets(group: Any, prefix: str = "", depth: int = 0) -> Iterator[tuple[str, tuple[tuple[int, ...], Any]]]:
    import h5py

    for count, name in enumerate(group):
        if count > COLUMNS or depth > DEPTH:
            raise TrajectoryError(group.file.filename, f"holds more than {COLUMNS:,} arrays in a group, or is too deep")
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        member = group[name]
        if isinstance(member, h5py.Group):
            yield from _data_sets(member, f"{prefix}{name}/", depth + 1)
        elif (
            isinstance(member, h5py.Dataset) and member.shape is not None and not (member.is_virtual or member.external)
        ):
            yield f"{prefix}{name}", (member.shape, member.dtype)


def _attributes(group: Any) -> Iterator[tuple[str, Any]]:
    for name, value in group.attrs.items():
        plain = value.item() if isinstance(value, np.generic) else value
        if isinstance(plain, str | int | float | bool):
            yield name, plain
