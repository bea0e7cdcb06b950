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
from gsl.storage.importers.formats import ENDS, is_bag, readable, stem
from gsl.storage.lerobot.dataset import Entry
from gsl.version import PACKAGE

HOME = PACKAGE.parent
MOST_FIELDS, MOST_SECONDS = 12, 2.0  # of a pattern of paths, and of CPU that it may take for a name


class Place(NamedTuple):
    """Files of one episode, or of several that a column tells apart.

    Attributes:
        name: Path below the source, without the end that tells the format.
        files: By role; the only one has the role "".
        entry: Which episode of a LeRobot data set it is, if it is of one.
    """

    name: str
    files: Mapping[str, Path]
    entry: Entry | None = None


def locate(source: str) -> str:
    """Return a source as it is, or below the folder of gsl's repository if it is only there."""
    if not glob.glob(source) and not Path(source).exists() and not os.path.isabs(source) and (HOME / source).exists():
        return os.path.relpath(HOME / source)
    return source


def places(source: str, files: str | Mapping[str, str] | None) -> list[Place]:
    """Return where the episodes of a source lie, in the order of their names.

    Args:
        source: A file, a folder, or a pattern such as logs/*.csv.
        files: Pattern of the files in a folder, or the names of one episode's files by role.

    Raises:
        InputError: There is nothing, or too much, or a file of an episode is missing.
    """
    try:
        with within(f"{source}: looking for logs in it"):
            return _places(source, files)
    except OSError as error:
        problem = f"cannot be looked into: {error.strerror} ({error.filename})"
        raise InputError(f"source = {source}: {problem}; name the folder of the logs") from error


def _places(source: str, files: str | Mapping[str, str] | None) -> list[Place]:
    base, found = _find(source)
    if isinstance(files, Mapping):
        return [_several(base, folder, files) for folder in _folders(source, found, files)]
    chosen = sorted({one for path in found for one in _below(path, files)})
    if not chosen:
        wanted = files or f"file that ends with {', '.join(ENDS)}"
        raise InputError(f"{source}: holds no {wanted}")
    return [Place(stem(_relative(path, base)), {"": path}) for path in chosen]


def _find(source: str) -> tuple[Path, list[Path]]:
    """Return the folder that names are relative to, and what the source names."""
    path = Path(source)
    if path.is_dir():
        return (path.parent if is_bag(path) else path), [path]
    if path.is_file():
        return path.parent, [path]
    if path.exists():
        raise InputError(f"source = {source}: is no plain file")
    found = [Path(one) for one in sorted(glob.glob(source, recursive=True))]
    if not found:
        raise InputError(f"source = {source}: there is no such file, folder or pattern")
    return Path(re.split(r"[*?\[]", source)[0]).parent if found else path, found


def _below(path: Path, pattern: str | None) -> Iterator[Path]:
    if not path.is_dir() or is_bag(path):
        yield path
        return
    below = sorted(one for one in path.rglob(pattern or "*") if readable(one) and not _is_hidden(one, path))
    bags = [one for one in below if one.is_dir()]
    yield from (one for one in below if not any(bag in one.parents for bag in bags))


def _is_hidden(path: Path, folder: Path) -> bool:
    return any(part.startswith(".") for part in path.relative_to(folder).parts)


def _folders(source: str, found: list[Path], files: Mapping[str, str]) -> list[Path]:
    """Return the folders that hold an episode's files."""
    first = next(iter(files.values()))
    folders = sorted({one.parent for path in found if path.is_dir() for one in path.rglob(first)})
    if not folders:
        named = " and ".join(files.values())
        raise InputError(f"{source}: the mapping wants folders with {named}, and there is none with {first}")
    return folders


def _several(base: Path, folder: Path, files: Mapping[str, str]) -> Place:
    chosen = {}
    for role, pattern in files.items():
        fitting = sorted(folder.glob(pattern))
        if len(fitting) != 1:
            told = f"{len(fitting)} files are called {pattern}" if fitting else f"there is no {pattern}"
            raise InputError(f"{folder}: {told}, which the mapping wants as its {role}")
        chosen[role] = fitting[0]
    name = _relative(folder, base)
    return Place(name if name != "." else folder.resolve().name, chosen)


def _relative(path: Path, base: Path) -> str:
    return Path(os.path.relpath(path, base)).as_posix()


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
