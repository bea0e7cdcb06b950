"""Metrics of single steps, such as generations and epochs: what is at work notes them, and who listens keeps them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Listener = Callable[[str, int, dict[str, float]], None]
"""Takes the name of a series, the number of a step from 1, and values by name."""

_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


def note_step(series: str, step: int, **values: float) -> None:
    """Note the values of a step; nothing happens where nobody listens, as in a worker process."""
    if (listener := _listener.get()) is not None:
        listener(series, step, values)


@contextmanager
def listen_to_steps(listener: Listener) -> Iterator[None]:
    """Within, steps are noted by `listener`."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)
