"""What the stages that diagnose share: their settings, and how they say what they are at."""

from __future__ import annotations

import time
from typing import Annotated, Literal

from pydantic import AfterValidator

from gsl.core.console import Console
from gsl.core.interruption import checkpoint
from gsl.core.setting import setting
from gsl.effects.effect import effect_class
from gsl.errors import ConfigError

QUIET = 15.0  # of a phase that takes long [s]


def _in_the_library(effects: tuple[str, ...]) -> tuple[str, ...]:
    """Refuse names that no effect has, before a robot moves."""
    for name in effects:
        try:
            effect_class(name)
        except ConfigError as error:
            raise ValueError(f"{name}: {error.problem}") from None
    return effects


Without = Annotated[
    tuple[str, ...], setting("effects that are left out of the library"), AfterValidator(_in_the_library)
]
Clocks = Annotated[
    Literal["synchronised", "unsynchronised"] | None,
    setting("whether commands and measurements share a clock, else no latency is claimed; what the log says if null"),
]
Most = Annotated[int, setting("effects at once, at most; parted over groups it counts once", ge=1, le=6)]
Duels = Annotated[int, setting("simulated logs of each surviving cause in the self-test", ge=0)]
Nulls = Annotated[int, setting("simulated logs without an effect in the self-test", ge=0)]
Tolerance = Annotated[float, setting("difference of a joint that does not matter, beside the noise", unit="rad", ge=0)]


class Telling:
    """Says a phase when it begins, and now and then how long it has been at it; nothing goes on after a Ctrl-C."""

    def __init__(self, console: Console) -> None:
        self._console, self._phase, self._fits = console, "", 0
        self._begun = self._said = time.monotonic()

    def __call__(self, phase: str) -> None:
        """Begin a phase; without a word, some work of it is done."""
        now = time.monotonic()
        if phase:
            self._console.status(phase)
            self._phase, self._fits, self._begun, self._said = phase, 0, now, now
            return
        checkpoint()
        self._fits += 1
        if now - self._said > QUIET:
            self._console.status(f"{self._phase}: {self._fits} fits in {now - self._begun:.0f} s")
            self._said = now
