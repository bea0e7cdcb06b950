"""How long a study will take, from a few rollouts of π0 in each of its worlds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING

from gsl.core.interfaces import REAL, SIM, Search, World
from gsl.core.words import several
from gsl.errors import ConfigError
from gsl.grounding.effects import is_learned
from gsl.policies.policy import size
from gsl.rollout.parallel import threads
from gsl.stages.effort import (
    APART,
    FLOWN,
    LEARNED,
    count_episodes,
    count_rollouts,
    flights,
    plan_search,
    seconds_of_rollout,
)
from gsl.stages.iterate import Iterate
from gsl.stages.values import Values

if TYPE_CHECKING:
    from gsl_experiments.compare import Compare
    from gsl_experiments.noise import NoiseStudy


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


def seconds_of_rounds(study: NoiseStudy, measure: Callable[[Iterate, World, str], float] = seconds_of_rollout) -> float:
    """Return an estimate of how long a study in noisy worlds takes from nothing [s], good to a factor of two or so.

    Args:
        study: With its worlds.
        measure: Returns how long a rollout takes in a world [s].
    """
    rounds, noises, learned = study.iterate.iterations, len(study.noises), list(map(is_learned, study.methods.values()))
    budget, places, started, total = study.iterate.budget, rounds * noises, set[str](), 0.0
    for name, real in study.worlds.items():
        sim, key = study.sims.get(name, study.iterate.sim), name if name in study.sims else ""
        own = replace(study.iterate, sim=sim, real=real, policy=size(study.iterate.policy, sim), workers=1)
        further = replace(own, optimizer=study.further)
        in_sim, in_real = measure(own, sim, SIM), measure(own, real, REAL)
        alone = 0 if key in started else 1  # what knows no world begins once in a simulator, with the same search
        searches = (places if knows else places - noises + alone for knows in learned)
        rolled = zip(searches, (in_sim * (LEARNED if knows else 1.0) for knows in learned), strict=True)
        total += sum(count * plan_search(further, each).seconds for count, each in rolled)
        total += alone * plan_search(own, in_sim).seconds + places * plan_search(further, in_real).seconds
        chosen = 0 if study.choice == REAL else study.further.generations  # in simulation: real sees one policy of all
        episodes = count_episodes(further) - chosen * budget.episodes
        total += places * (len(learned) + 1) * episodes * in_real
        if any(learned):
            total += noises * (sum(budget.real) * in_real + sum(budget.sim) * in_sim) + places * sum(learned) * APART
        started.add(key)
    return total * study.trials / min(threads(study.workers), study.trials)


def seconds_of_models(iterate: Iterate) -> float:
    """Return an estimate of how long an iteration's data and models take from nothing [s]."""
    real, sim = seconds_of_rollout(iterate, iterate.real, REAL), seconds_of_rollout(iterate, iterate.sim, SIM)
    rolled = sum(iterate.budget.real) * real + sum(iterate.budget.sim) * sim
    return rolled / threads(iterate.workers) + APART
