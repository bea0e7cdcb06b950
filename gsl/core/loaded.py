"""What a process has loaded of a user's own: modules stay as they were, whatever becomes of their files.

A long-lived process, such as a notebook, would else write results of old code down as those of the new one.
"""

from __future__ import annotations

import hashlib
import io
import os
import pickle
import sys
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

from gsl.core.own_code import is_elsewhere
from gsl.errors import GslError


class Stamp(NamedTuple):
    """A file as it was when its module was first seen here."""

    file: str
    sha256: str


_seen: dict[str, tuple[Any, Stamp]] = {}  # what each module was loaded by, which a reload replaces


def note(module: str) -> None:
    """Remember the file of a module of a user's own as it is now, unless that was seen before."""
    loaded = vars(sys.modules[module]) if isinstance(sys.modules.get(module), ModuleType) else {}
    file, spec = loaded.get("__file__"), loaded.get("__spec__")
    if file and is_elsewhere(file) and os.path.isfile(file) and (module not in _seen or _seen[module][0] is not spec):
        _seen[module] = spec, _stamp(file)


def check_contents(path: Path) -> None:
    """Refuse a file of a module that was loaded, if it is not what was loaded.

    Raises:
        GslError: It was changed since then.
    """
    for module, (_, stamp) in _seen.items():
        if stamp.file == str(path) and path.is_file() and _stamp(stamp.file) != stamp:
            raise GslError(f"{path}: was changed after it was loaded; start Python anew, or reload {module}")


def stamps() -> tuple[Stamp, ...]:
    """Return the files of all modules of a user's own, sorted: a process that has seen others runs other code."""
    for module in [*sys.modules]:
        note(module)
    return tuple(sorted(stamp for _, stamp in _seen.values()))


def pickle_with_code(thing: Any) -> tuple[bytes, tuple[Any, ...]]:
    """Return something pickled, and the classes and functions of a user's own that the bytes only name."""
    file = io.BytesIO()
    pickler = _Pickler(file)
    pickler.dump(thing)
    return file.getvalue(), tuple(pickler.code)


class _Pickler(pickle.Pickler):
    """Hears of classes and functions, of which a pickle holds the names."""

    def __init__(self, file: io.BytesIO) -> None:
        super().__init__(file)
        self.code: list[Any] = []

    def reducer_override(self, thing: Any) -> Any:
        """Note what is of a user's own, and leave the rest to pickle."""
        if isinstance(thing, type | FunctionType):
            file = getattr(sys.modules.get(thing.__module__), "__file__", None)
            if file is None or is_elsewhere(file):
                self.code.append(thing)
                note(thing.__module__)
        return NotImplemented


def _stamp(file: str) -> Stamp:
    return Stamp(file, hashlib.sha256(Path(file).read_bytes()).hexdigest())
