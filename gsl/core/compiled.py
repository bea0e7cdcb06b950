"""`compiled`: numba's njit with a cache on disk that is thrown away whenever gsl's sources change.

Numba looks only at the file of a compiled function itself, so an edit of another one that it calls would go unseen.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TypeVar

import numba

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compile a function when it is first called, or take it from the cache; threads may run it side by side."""
    if "NUMBA_CACHE_DIR" not in os.environ:
        numba.config.CACHE_DIR = _folder()  # type: ignore[attr-defined]
    return numba.njit(cache=True, nogil=True, error_model="numpy")(function)  # type: ignore[return-value]


@cache
def _folder() -> str:
    sources = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        sources.update(path.read_bytes())
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return str(home / "gsl" / f"numba-{sources.hexdigest()[:12]}")
