"""A search for parameters within a box, as system identification needs it."""

from __future__ import annotations

import numpy as np

from gsl.core.interfaces import SearchRun
from gsl.optimizers.cma_es import CmaEs


def box_search(
    start: np.ndarray, low: np.ndarray, high: np.ndarray, seed: int, *, candidates: int, generations: int, sigma: float
) -> SearchRun:
    """Return CMA-ES at its beginning, which asks for nothing outside the box.

    Args:
        start: Where to begin, shape (n,).
        low: Least values, shape (n,).
        high: Greatest values, shape (n,).
        seed: Of all randomness.
        candidates: Of a generation.
        generations: How often candidates will be asked for.
        sigma: First step size, as a share of the box.
    """
    settings = CmaEs(candidates=candidates, generations=generations, sigma=sigma)
    return settings.start(start, high - low, seed, bounds=(low, high))
