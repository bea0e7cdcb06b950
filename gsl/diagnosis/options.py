"""How a diagnosis works."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gsl.effects.effect import effect_class


@dataclass(frozen=True)
class Options:
    """How a diagnosis works.

    Attributes:
        without: Effects that are not candidates.
        most: Effects at once.
        duels: Simulated logs for each surviving cause; 0 tests nothing.
        nulls: Simulated logs without an effect.
        threads: That replay side by side.
        clocks: Whether commands and measurements have one clock; else latency is not claimed.
        spread: Of the robot's calibration about the simulator's, as a share of the usual spread of one make.
        seed: Of the simulated logs and of the learned residual.
        tolerance: Difference of a joint that does not matter, beside the noise [rad]: the model's roughness.
        held_out: Labels of the trajectories that are for checking; empty for every second motion.
    """

    without: tuple[str, ...] = ()
    most: int = 4
    duels: int = 2
    nulls: int = 3
    threads: int = 2
    clocks: bool = True
    spread: float = 1.0
    seed: int = 0
    tolerance: float = 0.0
    held_out: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse names that no effect has."""
        for name in self.without:
            effect_class(name)
