"""The policies that trials tried in the real world, and what told beforehand which of them would fall."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from gsl.core.statistics import Interval, concordance, mean_interval
from gsl.report.markdown import table
from gsl.stages.evaluate import TABLE
from gsl.storage.artifact import Artifact
from gsl.studies.trial import Trial

DIGITS = 6  # of a value that is kept


class Tried(NamedTuple):
    """The best of a generation in the real episodes of the choice.

    Attributes:
        generation: That found it, 0 for the policy that the search began with.
        promised: Its value in simulation; None of the first.
        drift: Share of its time where the grounding has seen nothing, None where none is learned.
        falls, episodes: Of the choice; up to the first fall where none is tolerated.
        value: Mean of these, falls counting as in the task.
    """

    generation: int
    promised: float | None
    drift: float | None
    falls: int
    episodes: int
    value: float


def tried(found: Mapping[str, Any], measured: Artifact) -> list[Tried]:
    """Return the policies of a search in their order, the one that it began with first.

    Args:
        found: Metrics of the search.
        measured: Evaluation of its policies.
    """
    drift = found.get("drift", {})
    rows = json.loads((measured.folder / TABLE).read_text(encoding="utf-8"))["policies"]
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


TELLERS: Mapping[str, Callable[[Tried], Any]] = {
    "promise": attrgetter("promised"),
    "generation": attrgetter("generation"),
    "drift": attrgetter("drift"),
}


def foretold(trials: Sequence[Trial]) -> str:
    """Return how well figures that the simulator gives tell which policies fall in real, nothing where none fell."""
    searches = [(trial, [Tried._make(one) for one in trial.tried[1:]]) for trial in trials if trial.tried]
    rows = []
    for cell in dict.fromkeys(trial.cell for trial, _ in searches):
        own = [search for trial, search in searches if trial.cell == cell]
        fell = [one.falls > 0 for search in own for one in search]
        where = " ".join(filter(None, (cell.simulator, cell.world)))
        telling = sum(len({one.falls for one in search}) > 1 for search in own)
        counts = f"{sum(fell)} of {len(fell)}", f"{telling} of {len(own)}"
        told = (where, cell.method, str(cell.iteration), *counts)
        rows.append((*told, *(_told(own, figure) for figure in TELLERS.values())))
    if not any(one.falls for _, search in searches for one in search):
        return ""
    head = (
        "What tells beforehand who falls: of two policies of a search, one of which falls more often in the choice,\n"
        "how often that is the one with the larger figure (.5 is chance; 95 % over the trials that have such two):\n"
    )
    titles = ("worlds", "grounding", "iteration", "tried that fell", "trials with such two", *TELLERS)
    return "\n".join([head, table(titles, rows)])


def _told(searches: Sequence[Sequence[Tried]], figure: Callable[[Tried], Any]) -> str:
    """Return the mean concordance of a figure with falls over searches and its interval, if there is one."""
    if any(figure(one) is None for search in searches for one in search):
        return ""
    every = [concordance([figure(one) for one in search], [one.falls for one in search]) for search in searches]
    some = [one for one in every if not np.isnan(one)]
    return _in_words(mean_interval(some)) if some else ""


def _in_words(found: Interval) -> str:
    """Return a mean concordance and its bounds for people; a single one has none."""
    bounds = "" if math.isinf(found.lower) else f" ({max(0.0, found.lower):.2f} to {min(1.0, found.upper):.2f})"
    return f"{found.mean:.2f}{bounds}"


def _short(value: float | None) -> float | None:
    return None if value is None else round(value, DIGITS)
