"""What an optimiser asks for, checked: candidates that a policy can act by."""

from __future__ import annotations

from typing import Any

import numpy as np

from gsl.errors import ConfigError


def check_candidates(asked: Any, count: int, candidates: int) -> list[np.ndarray]:
    """Return candidates as arrays, shape (count,) each.

    Args:
        asked: What `ask` has returned.
        count: Parameters of the policy.
        candidates: How many the optimiser's settings promise.

    Raises:
        ConfigError: There are more or fewer, or one has another shape or a number that is not finite.
    """
    try:
        arrays = [np.asarray(candidate, dtype=float) for candidate in asked]
    except (TypeError, ValueError) as error:
        raise ConfigError("optimizer", f"its ask() returned no list of candidates: {error}") from error
    if len(arrays) != candidates:
        problem = f"its ask() returned {len(arrays)} instead of the {candidates} candidates of its settings"
        raise ConfigError("optimizer", problem)
    for candidate in arrays:
        if candidate.shape != (count,):
            problem = f"its ask() returned a candidate of shape {candidate.shape}; the policy has {count} parameters"
            raise ConfigError("optimizer", problem)
        if not np.isfinite(candidate).all():
            raise ConfigError("optimizer", "its ask() returned a candidate with a number that is not finite")
    return arrays
