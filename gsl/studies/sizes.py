"""What a study's table tells of its sizes: the preset that they come from, and which trials there are."""

from __future__ import annotations

from typing import Annotated

from gsl.core.setting import setting
from gsl.stages.headline import several

PresetName = Annotated[str, setting("preset that the sizes come from, as the table tells it; empty of none")]

First = Annotated[int, setting("number of the first trial; trials of one number have the same seeds", ge=1)]


def numbers(first: int, count: int) -> range:
    """Return those of the trials."""
    return range(first, first + count)


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
