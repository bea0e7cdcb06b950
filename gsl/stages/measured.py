"""What measured episodes come to: means with intervals, falls, gains, and the rows that people see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gsl.core.statistics import difference_interval, mean_interval
from gsl.report.markdown import in_unit
from gsl.stages.headline import Unit
from gsl.stages.population import Episode
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
    told = [name for name in done[0].outcome if all(name in episode.outcome for episode in done)]
    outcome = {name: float(np.mean([episode.outcome[name] for episode in done])) for name in told}
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


def columns(outcomes: Sequence[str], unit: Unit) -> list[str]:
    """Return the titles of `cells`."""
    places = [in_unit(place, unit.name) for place in ("in simulation", "in real")]
    return ["policy", *places, "95 % interval", ends(unit), *outcomes]


def ends(unit: Unit) -> str:
    """Return the title over `ended`."""
    return "falls" if unit.falls else "episodes"


def ended(one: Mapping[str, Any], unit: Unit) -> str:
    """Return a cell for people: falls of episodes, or episodes alone."""
    return f"{one['falls']} of {one['episodes']}" if unit.falls else str(one["episodes"])


def cells(one: Mapping[str, Any], name: str, unit: Unit, outcomes: Sequence[str]) -> list[str]:
    """Return a row for people; a policy that stopped at its fall has no interval."""
    interval = unit.interval(one["interval"]) if np.isfinite(one["interval"]).all() and not one["falls"] else ""
    simulated = "" if one["value_sim"] is None else unit.bare(one["value_sim"])
    outcome = [f"{one['outcome'][name]:.1f}" if name in one["outcome"] else "" for name in outcomes]
    return [name, simulated, unit.bare(one["value"]), interval, ended(one, unit), *outcome]
