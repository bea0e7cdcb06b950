"""The policies that trials tried in the real world, and what told beforehand which of them would fall."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from typing import Any

from gsl.core.statistics import concordance, mean_interval
from gsl.report.markdown import table
from gsl.storage.artifact import Artifact
from gsl.storage.policy_choice import EVALUATION
from gsl_experiments.trial import Cell, Trial, Tried

DIGITS = 6  # of a value that is kept
FEWEST = 5  # trials for an interval
PREDICTORS: Mapping[str, Callable[[Tried], Any]] = {
    "promise": attrgetter("promised"),
    "generation": attrgetter("generation"),
    "drift": attrgetter("drift"),
}


def read_tried(search: Mapping[str, Any], measured: Artifact) -> list[Tried]:
    """Return the policies of a search in their order, the one that it began with first.

    Args:
        search: Metrics of the search.
        measured: Evaluation of its policies.
    """
    drift = search.get("drift", {})
    rows = json.loads((measured.folder / EVALUATION).read_text(encoding="utf-8"))["policies"]
    return [
        Tried(
            row["generation"] or 0,
            _short(row["value_sim"]),
            _short(drift.get(row["name"])),
            row["falls"],
            row["episodes"],
            round(row["value"], DIGITS),
        )
        for row in rows
    ]


def foretelling(trials: Sequence[Trial]) -> str:
    """Return as a table how well figures of the simulator tell which policies fall, nothing where none fell."""
    searches: dict[Cell, list[Sequence[Tried]]] = {}
    for trial in trials:
        if trial.tried:
            searches.setdefault(trial.cell, []).append(trial.tried[1:])
    if not any(policy.falls for own in searches.values() for search in own for policy in search):
        return ""
    rows = []
    for cell, own in searches.items():
        telling = [search for search in own if len({policy.falls for policy in search}) > 1]
        fell = [policy.falls > 0 for search in own for policy in search]
        counts = f"{sum(fell)} of {len(fell)}", f"{len(telling)} of {len(own)}"
        place = (cell.worlds, cell.method, str(cell.iteration), *counts)
        rows.append((*place, *(_format(telling, figure) for figure in PREDICTORS.values())))
    head = (
        "What predicts falls: how often, of two policies of a search, the larger figure is that of the policy which\n"
        "falls more often in the choice. 0.5 is chance. Shares are means over the trials that have such a pair\n"
        f"and whose policies were kept. They have a 95 % interval where {FEWEST} trials or more differ.\n"
    )
    titles = ("worlds", "grounding", "iteration", "tried that fell", "trials with such a pair", *PREDICTORS)
    return "\n".join([head, table(titles, rows)])


def _format(searches: Sequence[Sequence[Tried]], figure: Callable[[Tried], Any]) -> str:
    """Return the mean concordance of a figure with falls over searches and its interval, nothing if one lacks it."""
    if not searches or any(figure(policy) is None for search in searches for policy in search):
        return ""
    every = [
        concordance([figure(policy) for policy in search], [policy.falls for policy in search]) for search in searches
    ]
    interval = mean_interval(every)
    enough = len(every) >= FEWEST and interval.lower < interval.upper
    bounds = f" ({max(0.0, interval.lower):.2f} to {min(1.0, interval.upper):.2f})"
    return f"{interval.mean:.2f}{bounds * enough}"


def _short(value: float | None) -> float | None:
    return None if value is None else round(value, DIGITS)
