"""`compile_kernel` and `compile_inner`: numba's njit with a cache on disk, new whenever its sources change.

Numba looks only at the file of a compiled function itself, so an edit of another one that it calls would go unseen.
The sources are therefore the files that compile something, and all of gsl that these import. Where these files are does
not matter: copies of one version share what was compiled.
Nor does it look whether the machine code on the disk is what it wrote, so every file begins with a hash of the rest.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import event
from numba.core.caching import IndexDataCacheFile

from gsl.core.compiling import count_compilation

_HASH = hashlib.sha256().digest_size  # [bytes]
_COMPILING = (b"compile_kernel", b"compile_inner")
_IMPORT = re.compile(rb"^[ \t]*(?:from|import) (\w[\w.]*)(?: import (\([^)]*\)|[^\n]*))?", re.MULTILINE)
_OF_LANES, _CHOICES = re.compile(r"\b(lanes|mask)\b"), ("bool", "truth")  # what numba calls an `if`
F = TypeVar("F", bound=Callable[..., object])


class _Compilations(event.Listener):
    """Hears of every compilation, but not of what the cache has."""

    def on_start(self, event: Any) -> None:
        count_compilation(1)

    def on_end(self, event: Any) -> None:
        count_compilation(-1)


event.register("numba:compile", _Compilations())


def compile_kernel(function: F) -> F:
    """Compile a function when it is first called, or take it from the cache; threads may run it side by side.

    Where no folder can be written, there is no cache.
    """
    return _compile(function)


def compile_inner(function: F) -> F:
    """Compile a function of an inner loop, as part of whatever calls it; it allocates no array and returns none.

    Numba would count references to every array at every call, which costs a servo 40 times what it calculates.
    """
    return _compile(function, forceinline=True, _nrt=False)


def _compile(function: F, **more: bool) -> F:
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", **more}
    ours = ""
    try:
        if "NUMBA_CACHE_DIR" not in os.environ:
            numba.config.CACHE_DIR = ours = _folder()  # type: ignore[attr-defined]
        dispatcher = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # no home, or none that can be written
        dispatcher = numba.njit(**options)(function)
    kept: Any = getattr(dispatcher, "_cache", None)
    if hasattr(kept, "_impl"):  # not with NUMBA_DISABLE_JIT, or without a folder
        place, path = kept._impl, Path(kept.cache_path)
        if ours and path.parent == Path(ours):  # not where numba found no other place than beside the source
            path = path.with_name(function.__module__)  # it has a hash of where the source is
        kept._cache_file = _CheckedFiles(str(path), place.filename_base, place.locator.get_source_stamp())
    return dispatcher


def describe_uncompilable(error: BaseException) -> str | None:
    """Return where compiled code does what lanes (`gsl.core.lanes`) cannot and what to do, None of other errors."""
    if not isinstance(error, numba.TypingError):
        return None
    call, place = re.search(r">>> (\w+)\((.*)\)", str(error)), re.search(r'File "(.+)", line (\d+):', str(error))
    if not call or not place or not _OF_LANES.search(call[2]):
        return None
    where = f"{Path(place[1]).name}, line {place[2]}"
    if call[1] in _CHOICES:
        return f"{where}: the kernel computes several robots at once; choose by where(condition, yes, no), not by if"
    return f"{where}: the kernel has no {call[1]} for several robots at once; see docs/howto/own-components.md"


class _CheckedFiles(IndexDataCacheFile):
    """Numba's files of a function; what is not as it was written counts as missing, so that it is compiled again."""

    def _load_index(self) -> dict[Any, str]:
        try:
            version, stamp, overloads = pickle.loads(self._check(self._index_path))
        except OSError:
            return {}
        return overloads if (version, stamp) == (self._version, self._source_stamp) else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        self._write(self._index_path, (self._version, self._source_stamp, overloads))

    def _load_data(self, name: str) -> Any:
        return pickle.loads(self._check(self._data_path(name)))

    def _save_data(self, name: str, data: Any) -> None:
        self._write(self._data_path(name), data)

    def _write(self, path: str, thing: Any) -> None:
        contents = self._dump(thing)
        os.makedirs(self._cache_path, exist_ok=True)
        with self._open_for_write(path) as file:
            file.write(hashlib.sha256(contents).digest() + contents)

    def _check(self, path: str) -> bytes:
        stored = Path(path).read_bytes()
        if hashlib.sha256(stored[_HASH:]).digest() != stored[:_HASH]:
            _say_once(self._cache_path)
            raise OSError(f"{path} is damaged")
        return stored[_HASH:]


@cache
def _say_once(folder: str) -> None:
    sys.stderr.write(f"{folder}: compiled code is damaged there; it is compiled again\n")


@cache
def _folder() -> str:
    sources = hashlib.sha256(numba.__version__.encode())
    for path in find_sources(Path(__file__).parents[1]):
        sources.update(path.read_bytes())
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return str(home / "gsl" / f"numba-{sources.hexdigest()[:12]}")


def find_sources(package: Path) -> list[Path]:
    """Return the files of a package that compile a function, and all of it that these import, in order."""
    paths = {_name_module(path, package): path for path in package.rglob("*.py")}
    contents = {name: path.read_bytes() for name, path in paths.items()}
    waiting = [name for name, content in contents.items() if any(word in content for word in _COMPILING)]
    sources: set[str] = set()
    while waiting:
        if (name := waiting.pop()) not in sources and name in contents:
            sources.add(name)
            for module, names in _IMPORT.findall(contents[name]):
                whole = module.decode()
                waiting += [whole, *(f"{whole}.{part.decode()}" for part in re.findall(rb"\w+", names))]
    return sorted(paths[name] for name in sources)


def _name_module(path: Path, package: Path) -> str:
    return ".".join((package.name, *path.relative_to(package).with_suffix("").parts)).removesuffix(".__init__")
