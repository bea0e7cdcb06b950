"""The random state of the process: libraries of learning set it for all, and a caller's must be as it was."""

from __future__ import annotations

import random
import sys
from collections.abc import Iterator
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")


def keep_apart(steps: Iterator[T]) -> Iterator[T]:
    """Yield what an iterator yields, whose random state is its own: between its steps the caller's is in place."""
    inside = None
    while True:
        outside = _read()
        if inside is not None:
            _set(inside)
        try:
            step = next(steps)
        except StopIteration:
            return
        finally:
            inside = _read()
            _set(outside)
        yield step


def _read() -> tuple[Any, Any, Any]:
    torch = sys.modules.get("torch")
    return random.getstate(), np.random.get_state(), None if torch is None else torch.get_rng_state()


def _set(states: tuple[Any, Any, Any]) -> None:
    random.setstate(states[0])
    np.random.set_state(states[1])
    if states[2] is not None:
        sys.modules["torch"].set_rng_state(states[2])
