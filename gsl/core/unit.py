"""How people are shown the values of a task."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from gsl.core.words import falls, several, significant

MANY = 10.0  # times π0: a share of what is next to nothing, which tells people nothing


class Unit(NamedTuple):
    """How people are shown the values of a task: `factor` times the value, in `name`, with falls if it knows them."""

    factor: float = 1.0
    name: str = ""
    falls: bool = True

    @classmethod
    def of(cls, task: Any) -> Unit:
        """Return the unit of a task or of its class."""
        return cls(float(task.shown), str(task.unit), getattr(task, "falls", True))

    def format(self, value: float | None, *, sign: bool = False) -> str:
        """Return a value with its unit, `-` if there is none."""
        if value is None:
            return "-"
        return f"{self.bare(value, sign=sign)} {self.name}".rstrip()

    def bare(self, value: float | None, *, sign: bool = False, size: float | None = None) -> str:
        """Return a value without its unit; nobody knows how large values without one are, unless `size` tells."""
        if value is None:
            return "-"
        if not self.name:
            return significant(self.factor * value, sign=sign, size=size)
        return f"{self.factor * value:{'+' if sign else ''}.1f}"

    def interval(self, bounds: list[float | None], *, sign: bool = False) -> str:
        """Return an interval without its unit, `-` if it has no ends: one value tells none."""
        if any(bound is not None and math.isinf(bound) for bound in bounds):
            return "-"
        size = self.factor * max((abs(bound) for bound in bounds if bound is not None), default=0.0)
        return " to ".join(self.bare(bound, sign=sign, size=size) for bound in bounds)

    def describe_ends(self, summary: Mapping[str, Any]) -> str:
        """Return how often the robot fell in so many episodes, or the number of episodes."""
        episodes = summary["episodes"]
        return f"{falls(summary['falls'])} in {episodes}" if self.falls else several(episodes, "episode")


def telling(share: float) -> bool:
    """Return whether a gain as a share of π0's value tells people something: it is no more than `MANY` times it."""
    return abs(share) <= MANY


def format_gain(share: float | None) -> str:
    """Return a gain as a share of π0's value [%]; nothing without a share, or with one that is not telling."""
    return "" if share is None or not telling(share) else f"{100 * share:+.1f} %"
