"""What a user decides of a diagnosis, and how a stage says what it is at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator

from gsl.core.console import Console
from gsl.core.interruption import checkpoint
from gsl.core.setting import setting
from gsl.diagnosis.settings import DesignSettings, PlausibilitySettings, SearchSettings, VerdictSettings
from gsl.effects.effect import effect_class
from gsl.errors import ConfigError


def _check_names(effects: tuple[str, ...]) -> tuple[str, ...]:
    """Refuse names that no effect has, before a robot moves."""
    for name in effects:
        try:
            effect_class(name)
        except ConfigError as error:
            raise ValueError(f"{name}: {error.problem}") from None
    return effects


Without = Annotated[tuple[str, ...], setting("effects that are left out of the library"), AfterValidator(_check_names)]
Clocks = Annotated[
    Literal["synchronised", "unsynchronised"] | None,
    setting("whether commands and measurements share a clock, else no latency is claimed; what the log says if null"),
]
Most = Annotated[int, setting("effects at once, at most; parted over groups it counts once", ge=1, le=6)]
Duels = Annotated[int, setting("simulated logs of each surviving cause in the self-test", ge=0)]
Nulls = Annotated[int, setting("simulated logs without an effect in the self-test", ge=0)]
Tolerance = Annotated[float, setting("difference of a joint that does not matter, beside the noise", unit="rad", ge=0)]


class Chance(NamedTuple):
    """What the best effects gain over calibration alone in a simulated log that has none.

    Attributes:
        gain: In all.
        freed: By freeing the cost of shifts.
        level: Cost of a held-out residual that calibration alone leaves there.
        worst: The same of the worst joint.
    """

    gain: float
    freed: float
    level: float
    worst: float


@dataclass(frozen=True)
class Options:
    """How a diagnosis works.

    Attributes:
        without: Effects that are not candidates.
        most: Effects at once.
        duels: Simulated logs for each surviving cause; 0 tests nothing.
        nulls: Simulated logs without an effect.
        threads: That fit, screen and replay side by side.
        clocks: Whether commands and measurements have one clock; else latency is not claimed.
        spread: Of the robot's calibration about the simulator's, as a share of the usual spread of one make.
        seed: Of the simulated logs.
        tolerance: Difference of a joint that does not matter, beside the noise [rad]: the model's roughness.
        held_out: Labels of the trajectories that are for checking; empty for every second motion.
        chances: What chance gains on these commands in this world, if it was measured already.
        search, plausibility, verdict, design: The numbers that decide.
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
    chances: tuple[Chance, ...] = ()
    search: SearchSettings = field(default_factory=SearchSettings)
    plausibility: PlausibilitySettings = field(default_factory=PlausibilitySettings)
    verdict: VerdictSettings = field(default_factory=VerdictSettings)
    design: DesignSettings = field(default_factory=DesignSettings)

    def __post_init__(self) -> None:
        """Refuse names that no effect has."""
        for name in self.without:
            effect_class(name)


class PhaseReporter:
    """Reports a phase when it begins; nothing goes on after a Ctrl-C."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def __call__(self, phase: str = "") -> None:
        """Begin a phase; without a word, some work of it is done."""
        checkpoint()
        if phase:
            self._console.phase(phase)
