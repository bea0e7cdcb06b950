"""What an optimiser asks for, checked: candidates that a policy can act by."""

from __future__ import annotations

from typing import Any

import numpy as np

from gsl.errors import ConfigError


def check_candidates(asked: Any, count: int) -> list[np.ndarray]:
    """Return candidates as arrays, shape (count,) each.

    Args:
        asked: What `ask` has returned.
        count: Parameters of the policy.

    Raises:
        ConfigError: There is none, or one has another shape or a number that is not finite.
    """
    try:
        candidates = [np.asarray(candidate, dtype=float) for candidate in asked]
    except (TypeError, ValueError) as error:
        raise ConfigError("optimizer", f"its ask() returned no list of candidates: {error}") from error
    if not candidates:
        raise ConfigError("optimizer", "its ask() returned no candidate")
    for candidate in candidates:
        if candidate.shape != (count,):
            problem = f"its ask() returned a candidate of shape {candidate.shape}; the policy has {count} parameters"
            raise ConfigError("optimizer", problem)
        if not np.isfinite(candidate).all():
            raise ConfigError("optimizer", "its ask() returned a candidate with a number that is not finite")
    return candidates
