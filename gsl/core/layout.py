"""Where each measured quantity stands in a world's flat observation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

_SUFFIXES = {1: ("",), 2: (".left", ".right"), 3: (".x", ".y", ".z"), 4: (".x", ".y", ".z", ".w")}


@dataclass(frozen=True)
class Layout:
    """Names, sizes and order of an observation's parts.

    Attributes:
        joints: Names of the controlled joints: an action's entries, and those of `position` and `velocity`.
        sizes: Number of entries of each part, in order.
        control_period: Time between two actions [s].
    """

    joints: tuple[str, ...]
    sizes: Mapping[str, int]
    control_period: float

    def __getitem__(self, part: str) -> slice:
        """Return where a part stands."""
        start = 0
        for name, size in self.sizes.items():
            if name == part:
                return slice(start, start + size)
            start += size
        raise KeyError(part)

    @property
    def columns(self) -> Mapping[str, tuple[str, ...]]:
        """Trajectory columns of every part but the joints' positions and velocities."""
        return {part: _columns(part, size) for part, size in self.sizes.items() if part not in ("position", "velocity")}

    @property
    def size(self) -> int:
        """Length of an observation."""
        return sum(self.sizes.values())


def _columns(part: str, size: int) -> tuple[str, ...]:
    return tuple(part + suffix for suffix in _SUFFIXES[size])
