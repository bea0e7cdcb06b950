"""Draws that hang together in time: standard normal each, a share of the last one kept (an AR(1) process)."""

from __future__ import annotations

import numpy as np


class Draws:
    """What a stochastic model draws with in one episode.

    Args:
        rng: Where all comes from.
        memory: Correlation of a normal draw with the last one, one for all or shape (m,), from 0 to below 1.
    """

    def __init__(self, rng: np.random.Generator, memory: float | np.ndarray = 0.0) -> None:
        self._rng, self._memory = rng, memory
        self._fresh = np.sqrt(1.0 - np.square(memory))
        self._last: np.ndarray | None = None

    def normal(self, m: int) -> np.ndarray:
        """Return the next m standard normal numbers."""
        drawn = self._rng.standard_normal(m)
        self._last = drawn if self._last is None else self._memory * self._last + self._fresh * drawn
        return self._last

    def uniform(self) -> float:
        """Return a number from 0 to 1."""
        return float(self._rng.random())

    def index(self, count: int) -> int:
        """Return one of `count` indices."""
        return int(self._rng.integers(count))
