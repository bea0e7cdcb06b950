"""Stands in for gsl.core.validation beside a robot, where no names are guessed."""

from __future__ import annotations

from collections.abc import Iterable


def did_you_mean(word: str, candidates: Iterable[str], *, listed: bool = False) -> str:
    """Return no suggestion."""
    return ""
