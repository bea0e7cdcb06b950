"""The files that components read by themselves, such as a world's robot: parents of whatever is made with them.

The source of a user's own class is one of them: after an edit of it an artifact is made anew.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any

from gsl.core.loaded import check_contents, note
from gsl.core.own_code import is_own
from gsl.effects.effect import own
from gsl.errors import GslError


def read_files(thing: Any) -> dict[str, Path]:
    """Return the `read_files` of a component and of all components in it, by dotted name of the setting."""
    return dict(_find(thing, ""))


def own_effects() -> dict[str, Path]:
    """Return the sources of effects of a user's own: the library, and with it any artifact, depends on them."""
    return {f"effect.{name}{k or ''}": path for name, kind in own().items() for k, path in enumerate(_sources(kind))}


def _find(thing: Any, where: str) -> Iterator[tuple[str, Path]]:
    if isinstance(thing, Mapping):
        parts = {str(key): value for key, value in thing.items()}
    elif isinstance(thing, list | tuple):
        parts = {str(index): value for index, value in enumerate(thing)}
    elif is_dataclass(thing) and not isinstance(thing, type):
        parts = {field.name: getattr(thing, field.name) for field in fields(thing)}
        own: Mapping[str, Path] = getattr(thing, "read_files", {})
        for path in own.values():
            check_contents(path)
        yield from ((f"{where}{name}", path) for name, path in own.items())
        sources = _sources(type(thing))
        if where:  # the stage itself is part of its identity, with its whole package
            yield from ((f"{where}_target_{k or ''}", path) for k, path in enumerate(sources))
    else:
        return
    for name, part in parts.items():
        yield from _find(part, f"{where}{name}.")


def _sources(kind: type) -> list[Path]:
    """Return the files of a class and of what it derives from, gsl's own and Python's left out.

    Raises:
        GslError: One has no file, or its file is not what was loaded.
    """
    files = [_source(base) for base in kind.__mro__ if is_own(base)]
    return list(dict.fromkeys(Path(file) for file in files if file))


def _source(kind: type) -> str | None:
    note(kind.__module__)
    try:
        file = inspect.getsourcefile(kind)
    except (OSError, TypeError):
        file = None
    if file and Path(file).is_file():
        check_contents(Path(file))
        return file
    loaded = getattr(sys.modules.get(kind.__module__), "__file__", None) or ""
    if loaded.endswith(tuple(EXTENSION_SUFFIXES)):
        return None
    problem = "has no file, and an artifact notes that of its components; put it into a module"
    raise GslError(f"{kind.__qualname__}, of a notebook or prompt, {problem}")
