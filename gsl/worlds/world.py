"""What a world is: a configuration that builds a gymnasium environment with a known layout."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import gymnasium

from gsl.core.layout import Layout


@runtime_checkable
class World(Protocol):
    """A body to act on; `make` builds it."""

    @property
    def layout(self) -> Layout:
        """What an observation holds."""

    def make(self) -> gymnasium.Env:
        """Build the environment."""
