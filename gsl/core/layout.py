"""Where each measured quantity stands in a world's flat observation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from gsl.errors import ConfigError

SUFFIXES = {1: ("",), 2: (".left", ".right"), 3: (".x", ".y", ".z"), 4: (".x", ".y", ".z", ".w")}
"""Ends of the names of a part's entries, by their number; but those of joints."""


@dataclass(frozen=True)
class Layout:
    """Names, sizes and order of an observation's parts.

    Attributes:
        joints: Names of the controlled joints: an action's entries, and those of `position` and `velocity`. A world
            whose state is not joints has the part `state` alone, and its actions' entries are named by number.
        sizes: Number of entries of each part, in order.
        control_period: Time between two actions [s].
        cells: Number of states where the state is the number of one of them, else 0.
        choices: Number of actions where an action is the number of one of them, else 0.
        ranges: Ends of each action in the environment's own unit, where actions are scaled to -1 to 1.
    """

    joints: tuple[str, ...]
    sizes: Mapping[str, int]
    control_period: float
    cells: int = 0
    choices: int = 0
    ranges: tuple[tuple[float, float], ...] = ()

    def __getitem__(self, part: str) -> slice:
        """Return where a part stands."""
        start = 0
        for name, size in self.sizes.items():
            if name == part:
                return slice(start, start + size)
            start += size
        raise KeyError(part)

    def numbers(self, joints: Sequence[str]) -> list[int]:
        """Return which of the joints some of them are."""
        return [self.joints.index(joint) for joint in joints]

    @property
    def states(self) -> int:
        """Number of entries of a state that is not joints; 0 for a robot."""
        return self.sizes.get("state", 0)

    @property
    def columns(self) -> Mapping[str, tuple[str, ...]]:
        """Trajectory columns of every part but the joints' positions and velocities."""
        return {part: _columns(part, size) for part, size in self.sizes.items() if part not in ("position", "velocity")}

    @property
    def size(self) -> int:
        """Length of an observation."""
        return sum(self.sizes.values())


def _columns(part: str, size: int) -> tuple[str, ...]:
    return tuple(part + suffix for suffix in SUFFIXES[size])


def check_alike(sim: Layout, real: Layout) -> None:
    """Refuse a real world with other joints, states or actions than the simulator.

    Raises:
        ConfigError: They differ.
    """
    for name, ours, theirs in (
        ("discrete states", sim.cells, real.cells),
        ("states", sim.states, real.states),
        ("discrete actions", sim.choices, real.choices),
        ("actions", len(sim.joints), len(real.joints)),
    ):
        if ours != theirs:
            real_count, sim_count = (count or "no" for count in (theirs, ours))
            raise ConfigError("real", f"has {real_count} {name}, the simulator {sim_count}; a policy must fit both")
    if sim.ranges != real.ranges:
        here, there = (", ".join(f"{low:g} to {high:g}" for low, high in layout.ranges) for layout in (sim, real))
        problem = f"takes actions of {there}, the simulator of {here}; an action must mean the same in both"
        raise ConfigError("real", f"{problem}: give them one range, and limit it inside of one")
    if abs(sim.control_period - real.control_period) > 1e-9:
        rates = f"acts every {real.control_period:g} s, the simulator every {sim.control_period:g} s"
        raise ConfigError("real", f"{rates}; a change within a step must mean the same in both")
    if sim.joints != real.joints:
        different = ", ".join(sorted(set(sim.joints) ^ set(real.joints))) or "their order"
        raise ConfigError("real", f"has other joints than the simulator ({different}); a policy must fit both")
