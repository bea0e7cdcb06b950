"""How a diagnosis works."""

from __future__ import annotations

from dataclasses import dataclass

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
    """

    without: tuple[str, ...] = ()
    most: int = 4
    duels: int = 2
    nulls: int = 3
    threads: int = 2
    clocks: bool = True
    spread: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse names that no effect has."""
        for name in self.without:
            effect_class(name)
