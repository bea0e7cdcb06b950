"""The preset that a study's sizes come from, as its table tells it."""

from __future__ import annotations

from typing import Annotated

from gsl.core.setting import setting

PresetName = Annotated[str, setting("preset that the sizes come from, as the table tells it; empty of none")]


def sizes_of(preset_name: str) -> str:
    """Return the words for it."""
    return (
        f"Sizes: preset={preset_name}, but for what the command says otherwise."
        if preset_name
        else "Sizes: of no preset."
    )
