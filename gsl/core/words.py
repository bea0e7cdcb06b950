"""Counts, numbers and units in words, as people are shown them."""

from __future__ import annotations

import math
from collections.abc import Sequence

MANY = 6  # effects, more of which are counted and not named


def significant(value: float, *, sign: bool = False, size: float | None = None) -> str:
    """Return a number of any size with one decimal, with two below 1, with two digits that count below .01.

    Args:
        value: The number.
        sign: Whether a plus is told.
        size: What decides instead of the value, of two bounds the larger.
    """
    size = abs(value if size is None else size)
    places = 1 if not 0.0 < size < 1.0 else 2 if size >= 0.01 else 1 - math.floor(math.log10(size))
    return f"{value:{'+' if sign else ''}.{places}f}"


def in_unit(title: str, unit: str) -> str:
    """Return a title with its unit in brackets, if it has one."""
    return f"{title} [{unit}]" if unit else title


def several(count: int, what: str) -> str:
    """Return a count of things."""
    return f"{count} {what}{'s' * (count != 1)}"


def falls(count: int) -> str:
    """Return how often the robot fell."""
    return f"{count or 'no'} fall{'s' * (count != 1)}"


def duration(seconds: float) -> str:
    """Return a time [s] as a person says it."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def size(count: int) -> str:
    """Return a size of so many bytes."""
    if count < 10_000:
        return f"{count:,} B"
    return f"{count / 1e3:,.0f} kB" if count < 10_000_000 else f"{count / 1e6:,.0f} MB"


def name_effects(effects: Sequence[str]) -> str:
    """Return effects by name, or only how many they are."""
    names = tuple(dict.fromkeys(effects))
    return ", ".join(names) if len(names) <= MANY else f"{len(names)} effects"
