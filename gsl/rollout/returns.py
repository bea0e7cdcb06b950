"""What measured episodes come to: means with intervals, falls and gains."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gsl.core.statistics import difference_interval, mean_interval
from gsl.rollout.parallel import Episode
from gsl.storage.policies import PolicyRecord


def falls(done: Sequence[Episode]) -> int:
    """Return how many episodes ended in a fall."""
    return sum(episode.fell for episode in done)


def mean(done: Sequence[Episode]) -> float:
    """Return the mean value."""
    return float(np.mean([episode.value for episode in done]))


def summary(done: Sequence[Episode]) -> dict[str, Any]:
    """Return mean value with its 95 % interval, falls, number of episodes, and the mean of what all of them tell.

    A value that somebody wrote down tells of nothing besides.
    """
    interval = mean_interval([episode.value for episode in done])
    measures = [name for name in done[0].outcome if all(name in episode.outcome for episode in done)]
    outcome = {name: float(np.mean([episode.outcome[name] for episode in done])) for name in measures}
    bounds = [interval.lower, interval.upper]
    return {"value": interval.mean, "interval": bounds, "falls": falls(done), "episodes": len(done), "outcome": outcome}


def row(theta: PolicyRecord, done: Sequence[Episode]) -> dict[str, Any]:
    """Return what an evaluation says of a policy."""
    about = {"name": theta.name, "generation": theta.generation, "value_sim": theta.value_sim}
    return {**about, **summary(done), "values": [episode.value for episode in done]}


def gain(after: Sequence[Episode], before: Sequence[Episode]) -> dict[str, Any]:
    """Return mean(after) - mean(before) with Welch's 95 % interval, and its share of the latter if that is above 0.

    Where the latter's own interval holds 0 there is no share: None.
    """
    values = [np.array([episode.value for episode in done]) for done in (after, before)]
    shared = mean_interval(values[1]).lower > 0.0
    if after is before:
        return {"value": 0.0, "interval": [0.0, 0.0], "share": 0.0 if shared else None}
    difference = difference_interval(*values)
    share = difference.mean / mean(before) if shared else None
    return {"value": difference.mean, "interval": [difference.lower, difference.upper], "share": share}
