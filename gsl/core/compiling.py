"""Whether numba compiles right now, which the first command after an installation waits for, a minute or two."""

from __future__ import annotations

_running = 0


def is_compiling() -> bool:
    """Whether a function is being compiled; one that is loaded from the cache on disk is not."""
    return _running > 0


def count_compilation(change: int) -> None:
    """Note that a compilation begins (1) or ends (-1); numba lets one thread compile at a time."""
    global _running
    _running += change
