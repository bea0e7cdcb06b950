"""Stands in for gsl.core.setting beside a robot: a component is a frozen dataclass; checked it was before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


def setting(meaning: str, **about: Any) -> str:
    """Return the meaning, which nobody asks for here."""
    return meaning


def component(cls: type) -> Any:
    """Make a class a frozen dataclass."""
    return dataclass(frozen=True)(cls)
