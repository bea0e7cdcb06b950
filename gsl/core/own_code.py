"""Errors in a user's own classes, as one line that names the class, the method and the place."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from gsl.errors import GslError

OURS = "gsl"


def is_own(kind: type) -> bool:
    """Whether a class is not gsl's but somebody's own."""
    return kind.__module__.partition(".")[0] not in (OURS, "builtins", "abc", "typing")


@contextmanager
def name_failures(thing: Any, method: str) -> Iterator[None]:
    """Within, whatever a method of a user's own object raises becomes one line.

    Args:
        thing: Whose method is called.
        method: Its name.

    Raises:
        GslError: It has raised something, and is not gsl's.
    """
    try:
        yield
    except GslError:
        raise
    except Exception as error:
        if not is_own(type(thing)):
            raise
        frame = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{frame.filename.rpartition('/')[2]}, line {frame.lineno}"
        text = " ".join(str(error).split())
        name = f"{type(thing).__module__}.{type(thing).__qualname__}.{method}"
        raise GslError(f"{name} failed ({place}): {type(error).__name__}: {text}") from error
