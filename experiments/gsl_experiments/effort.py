"""How long a study will take, from a few rollouts of π0 in each of its worlds."""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING

from gsl.core.interfaces import REAL, SIM, Search
from gsl.core.words import several
from gsl.errors import ConfigError
from gsl.grounding.effects import is_learned
from gsl.rollout.parallel import threads
from gsl.stages.effort import (
    APART,
    FLOWN,
    LEARNED,
    count_episodes,
    count_rollouts,
    flights,
    seconds_of_rollout,
)
from gsl.stages.iterate import Iterate
from gsl.stages.values import Values

if TYPE_CHECKING:
    from gsl_experiments.compare import Compare


def duration_told(duration: float) -> str:
    """Return words for a duration [s]."""
    minutes = max(1, round(duration / 60.0))
    return f"about {several(minutes, 'minute')}" if minutes < 90 else f"about {minutes / 60.0:.1f} hours"


def check_search(iterate: Iterate, where: str) -> None:
    """Refuse an optimizer that does not search; `where` is the setting that the iteration is."""
    if not isinstance(iterate.optimizer, Search):
        raise ConfigError(f"{where}.optimizer", "studies of robots search: take cma_es")


def seconds(study: Compare, *, search: bool = True) -> float:
    """Return an estimate of a study's duration from nothing [s], good to a factor of two or so.

    Without searches it is that of data, models and diagnoses.
    """
    iterate, budget = study.iterate, study.iterate.budget
    searched = measured = 0
    if search:
        assert isinstance(iterate.optimizer, Search), "check_search() has refused others"
        searched, measured = count_rollouts(iterate), count_episodes(iterate)
    workers = threads(iterate.workers)
    sims = study.simulators or {"": iterate.sim}
    real = sum(seconds_of_rollout(iterate, world, REAL) for world in study.worlds.values()) / len(study.worlds)
    sim = sum(seconds_of_rollout(iterate, world, SIM) for world in sims.values()) / len(sims)
    collected = sum(budget.real), sum(budget.sim)
    rounds, worlds = iterate.iterations * len(study.worlds), len(study.worlds)
    flown_by = {name: parts for name, method in study.methods.items() if (parts := flights(method))}
    rolled = fitted = 0.0
    for name, method in study.methods.items():
        apart = is_learned(method) or name in flown_by
        searches = rounds if apart else rounds - worlds + 1  # what knows no world searches first for all of them
        rolled += searches * searched * sim * (LEARNED if is_learned(method) else 1.0) + rounds * measured * real
        rolled += (worlds if apart else 1) * Values.count * sim if study.rank else 0.0
        if is_learned(method):
            further = rounds - worlds  # whose data are a method's own; in the first simulators with effects are
            rolled += further * collected[0] * real + (rounds if name in flown_by else further) * collected[1] * sim
            fitted += rounds * APART
    if any(map(is_learned, study.methods.values())):
        rolled += worlds * collected[0] * real + collected[1] * sim
    flown = len(iterate.diagnosis.excitation.motions) * iterate.diagnosis.excitation.duration if flown_by else 0.0
    fitted += worlds * flown * sum(FLOWN[part] for part in set(chain(*flown_by.values())))
    return (rolled / workers + fitted) * study.trials * len(sims)


def seconds_of_models(iterate: Iterate) -> float:
    """Return an estimate of how long an iteration's data and models take from nothing [s]."""
    real, sim = seconds_of_rollout(iterate, iterate.real, REAL), seconds_of_rollout(iterate, iterate.sim, SIM)
    rolled = sum(iterate.budget.real) * real + sum(iterate.budget.sim) * sim
    return rolled / threads(iterate.workers) + APART
