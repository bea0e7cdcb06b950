"""Values of trajectories' labels, which come from files, paths and command lines: 100, 100.0 and "100" are the same."""

from __future__ import annotations

from typing import Any


def alike(first: Any, second: Any) -> bool:
    """Whether two values are the same: as numbers where both are numbers, as they are written otherwise."""
    if first is None or second is None:
        return first is second
    numbers = _number(first), _number(second)
    return str(first) == str(second) or (None not in numbers and numbers[0] == numbers[1])


def _number(value: Any) -> float | None:
    if isinstance(value, bool):
        return None
    try:
        return float(value)
    except (TypeError, ValueError):
        return None
