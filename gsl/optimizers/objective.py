"""What a search maximises of a candidate's episodes: their mean value, or that of the worst share of them.

The latter is the conditional value at risk, CVaR (Rockafellar and Uryasev, 2000): a policy that is good in most draws
of a simulator and falls in some is worth little. Rajeswaran et al. train on it over an ensemble (EPOpt, 1610.01283).
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from gsl.core.interfaces import Learner, Search
from gsl.core.setting import setting
from gsl.errors import ConfigError

CVAR: Literal["cvar"] = "cvar"

Objective = Annotated[
    Literal["mean", "cvar"],
    setting("what is maximised of a candidate's episodes: their mean, or the mean of the worst of them"),
]
Quantile = Annotated[float, setting("the worst share of the episodes that objective=cvar counts", gt=0, le=1)]


def objective_values(values: np.ndarray, objective: str, quantile: float) -> np.ndarray:
    """Return what a search maximises, shape (n,).

    Args:
        values: Of every candidate's episodes, shape (n, rollouts).
        objective: `mean` or `cvar`.
        quantile: The share of the episodes that `cvar` counts; of one that falls between two, a part.
    """
    return worst_mean(values, quantile) if objective == CVAR else values.mean(axis=1)


def worst_mean(values: np.ndarray, share: float) -> np.ndarray:
    """Return the mean of the worst share of each row's values, shape (n,); the least value if the share is below one.

    Args:
        values: Shape (n, k).
        share: Between 0 and 1; of k times this many values the last counts in part (Rockafellar and Uryasev, 2002).
    """
    count = values.shape[1]
    size = max(1.0, share * count)
    weights = np.clip(size - np.arange(count), 0.0, 1.0)
    return np.asarray(np.sort(values, axis=1) @ weights / size)


def check_objective(objective: str, optimizer: Search | Learner) -> None:
    """Refuse an objective that the optimiser does not know.

    Raises:
        ConfigError: A learner has an objective of its own.
    """
    if objective == CVAR and not isinstance(optimizer, Search):
        raise ConfigError(
            "objective",
            "is for a search such as cma_es; a learner maximises the mean",
            given=objective,
        )
