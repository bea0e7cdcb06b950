"""Stands in for gsl.core.compiled beside a robot: Python does what the compiler would have done, to the bit."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

F = TypeVar("F", bound=Callable[..., object])


def compile_kernel(function: F) -> F:
    """Return the function."""
    return function
