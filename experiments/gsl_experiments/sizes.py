"""The sizes of a study: the preset that they come from, which trials there are, along what its curves go."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated

from gsl.core.setting import setting
from gsl.core.words import several
from gsl.errors import ConfigError

PresetName = Annotated[str, setting("preset that the sizes come from, as the table tells it; empty of none")]

First = Annotated[int, setting("number of the first trial; trials of one number have the same seeds", ge=1)]


def numbers(first: int, count: int) -> range:
    """Return those of the trials."""
    return range(first, first + count)


def check_rising(name: str, values: Sequence[float]) -> None:
    """Refuse the values of a curve that goes back, or has one of them twice."""
    if any(after <= before for before, after in pairwise(values)):
        numbers = ",".join(f"{value:g}" for value in values)
        raise ConfigError(name, "are to rise, the least of them first", given=f"[{numbers}]")


def sizes_of(preset_name: str) -> str:
    """Return the words for it."""
    return (
        f"Sizes: preset={preset_name}, but for what the command says otherwise."
        if preset_name
        else "Sizes: of no preset."
    )


def trials_of(first: int, count: int) -> str:
    """Return how many trials there are, and which, if they are not the first."""
    which = str(first) if count == 1 else f"{first} to {first + count - 1}"
    return several(count, "trial") + (f" ({which})" if first > 1 else "")
