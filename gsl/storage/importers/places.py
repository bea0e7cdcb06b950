"""Places are where the episodes of a log lie: one file each, or a folder that holds several files of one episode."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from gsl.core.budget import within
from gsl.errors import ConfigError, InputError
from gsl.storage import manifest
from gsl.storage.importers.formats import ENDS, HDF5, is_bag, is_npy_folder, readable, stem
from gsl.storage.importers.hdf5_arrays import list_groups
from gsl.storage.lerobot.dataset import Entry
from gsl.storage.origin import relative
from gsl.version import PACKAGE

HOME = PACKAGE.parent
MOST_FIELDS, MOST_SECONDS = 12, 2.0  # of a pattern of paths, and of CPU that it may take for a name


class Place(NamedTuple):
    """Files of one episode, or of several that a column tells apart.

    Attributes:
        name: Path below the source, without the end that tells the format.
        files: By role; the only one has the role "".
        entry: Which episode of a LeRobot data set it is, if it is of one.
        group: Of an HDF5 file, if each of several is an episode.
    """

    name: str
    files: Mapping[str, Path]
    entry: Entry | None = None
    group: str | None = None


def locate(source: str) -> str:
    """Return a source as it is, or below the folder of gsl's repository if it is only there."""
    with within(f"{source[:80]}: looking for logs in it"):
        there = bool(glob.glob(source)) or Path(source).exists()
    if not there and not os.path.isabs(source) and (HOME / source).exists():
        return os.path.relpath(HOME / source)
    return source


def places(source: str, files: str | Mapping[str, str] | None, records: str = "") -> list[Place]:
    """Return where the episodes of a source lie, in the order of their names.

    Args:
        source: A file, a folder, or a pattern such as logs/*.csv.
        files: Pattern of the files in a folder, or the names of one episode's files by role.
        records: Pattern of groups of an HDF5 file, an episode each.

    Raises:
        InputError: There is nothing, or too much, or a file of an episode is missing.
    """
    try:
        with within(f"{source}: looking for logs in it"):
            return _places(source, files, records)
    except (ValueError, NotImplementedError, re.error) as error:
        raise ConfigError("mapping.files", f"is no pattern of files: {error}", given=str(files)[:80]) from error
    except OSError as error:
        problem = f"cannot be looked into: {error.strerror} ({error.filename})"
        raise InputError(f"source = {source}: {problem}; name the folder of the logs") from error


def _places(source: str, files: str | Mapping[str, str] | None, records: str) -> list[Place]:
    base, paths = _find(source)
    if isinstance(files, Mapping):
        return [place for folder in _folders(source, paths, files) for place in _several(base, folder, files)]
    chosen = sorted({file for path in paths for file in _within(path, files)})
    if not chosen:
        raise InputError(_nothing(source, paths, files))
    return [place for path in chosen for place in _apart(Place(stem(relative(path, base)), {"": path}), records)]


def _nothing(source: str, paths: list[Path], pattern: str | None) -> str:
    """Return what to say where no file fits: that there are some further down, if there are."""
    wanted = pattern or f"file that ends with {', '.join(ENDS)}"
    below = f"**/{pattern or '*'}"
    there = [file for path in paths if path.is_dir() for file in _fitting(path, below)]
    if not there:
        return f"{source}: holds no {wanted}"
    deeper = f"{len(there)} in folders below, such as {os.path.relpath(there[0])}"
    return f"{source}: holds no {wanted}; there are {deeper}: mapping.files='{below}' takes them"


def _apart(place: Place, records: str) -> list[Place]:
    """Return the episodes of an HDF5 file whose groups a pattern such as data/demo_* names; else the place."""
    (path,) = place.files.values()
    if "*" not in records or path.suffix not in HDF5:
        return [place]
    return [place._replace(name=f"{place.name}/{group}", group=group) for group in list_groups(path, records)]


def _find(source: str) -> tuple[Path, list[Path]]:
    """Return the folder that names are relative to, and what the source names."""
    path = Path(source)
    if path.is_dir():
        return (path.parent if is_bag(path) or is_npy_folder(path) else path), [path]
    if path.is_file():
        return path.parent, [path]
    if path.exists():
        raise InputError(f"source = {source}: is no plain file")
    if path.is_symlink():
        raise InputError(f"source = {source}: is a link that leads nowhere")
    paths = [Path(path) for path in sorted(glob.glob(source, recursive=True))]
    if not paths:
        raise InputError(f"source = {source}: there is no such file, folder or pattern")
    return Path(re.split(r"[*?\[]", source)[0]).parent if paths else path, paths


def _within(path: Path, pattern: str | None) -> Iterator[Path]:
    """Return what is read of a path: itself, or the files in it, and in folders below if the pattern says so."""
    whole = is_bag(path) or (pattern is None and is_npy_folder(path))
    yield from [path] if whole or not path.is_dir() else _fitting(path, pattern or "*")


def _fitting(folder: Path, pattern: str) -> list[Path]:
    below = sorted(
        path
        for path in folder.glob(pattern)
        if readable(path) and not _is_hidden(path, folder) and not _is_about_a_run(path)
    )
    whole = {path for path in below if path.is_dir()}
    return [path for path in below if not whole.intersection(path.parents)]


def _is_hidden(path: Path, folder: Path) -> bool:
    return any(part.startswith(".") for part in path.relative_to(folder).parts)


def _is_about_a_run(path: Path) -> bool:
    """Whether a file is the log, the settings or the like of an artifact of ours, such as a folder of an export."""
    return path.name in manifest.ABOUT and (path.parent / manifest.NAME).is_file()


def _folders(source: str, paths: list[Path], files: Mapping[str, str]) -> list[Path]:
    """Return the folders that hold an episode's files."""
    first = next(iter(files.values()))
    folders = sorted({file.parent for path in paths if path.is_dir() for file in path.rglob(first)})
    if not folders:
        named = " and ".join(files.values())
        raise InputError(f"{source}: the mapping wants folders with {named}, and there is none with {first}")
    return folders


def _several(base: Path, folder: Path, files: Mapping[str, str]) -> list[Place]:
    """Return the episode of a folder, or several whose files go together by what `*` stands for in their names."""
    fitting = {role: sorted(folder.glob(pattern)) for role, pattern in files.items()}
    name = relative(folder, base)
    name = name if name != "." else folder.resolve().name
    if all(len(own) == 1 for own in fitting.values()):
        return [Place(name, {role: own[0] for role, own in fitting.items()})]
    if all(pattern.count("*") == 1 and "/" not in pattern for pattern in files.values()):
        apart = {role: {_star(file.name, files[role]): file for file in own} for role, own in fitting.items()}
        keys = sorted({key for own in apart.values() for key in own})
        for key in keys:
            for role, pattern in files.items():
                if key not in apart[role]:
                    due = pattern.replace("*", key)
                    raise InputError(f"{folder}: there is no {due}, which the mapping wants as the {role} of {key}")
        return [Place(f"{name}/{key}", {role: own[key] for role, own in apart.items()}) for key in keys]
    role, own = next((role, own) for role, own in fitting.items() if len(own) != 1)
    problem = f"{len(own)} files are called {files[role]}" if own else f"there is no {files[role]}"
    how = "; one * in the name of every role pairs files by what it stands for" if own else ""
    raise InputError(f"{folder}: {problem}, which the mapping wants as its {role}{how}")


def _star(name: str, pattern: str) -> str:
    """Return what the * of a pattern stands for in a name."""
    before, after = pattern.split("*")
    return name[len(before) : len(name) - len(after)]


def fields_of(name: str, pattern: str) -> dict[str, str]:
    """Return the parts of an episode's path by name; `{date}/{motion}` takes apart 2026-01-23/steps.

    Raises:
        ConfigError: The path is not of this pattern.
    """
    if not pattern:
        return {}
    parts = re.split(r"\{(\w+)\}", pattern)
    if len(parts) // 2 > MOST_FIELDS:
        raise ConfigError("mapping.path", f"names more than {MOST_FIELDS} parts", given=pattern)
    try:
        form = "".join(f"(?P<{part}>[^/]+?)" if index % 2 else re.escape(part) for index, part in enumerate(parts))
        with within("mapping.path: taking names apart", seconds=MOST_SECONDS):
            fitting = re.fullmatch(f"(?:.*/)?{form}", name)
    except re.error as error:
        raise ConfigError("mapping.path", f"is no pattern: {error}", given=pattern) from error
    if fitting is None:
        raise ConfigError("mapping.path", f"does not fit the episode {name}", given=pattern)
    return fitting.groupdict()
