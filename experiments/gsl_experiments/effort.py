"""How long a study will take, from a few rollouts of π0 in each of its worlds."""

from __future__ import annotations

import time
from itertools import chain
from typing import TYPE_CHECKING

from gsl.core.interfaces import REAL, SIM, Grounding, Search, World
from gsl.core.words import several
from gsl.errors import ConfigError
from gsl.grounding.effects import DiagnosedEffects, innermost, is_learned
from gsl.grounding.none import NoGrounding
from gsl.grounding.servo import LearnedServo
from gsl.rollout.parallel import threads
from gsl.rollout.rollout import Scenario, rollout
from gsl.stages.iterate import Iterate
from gsl.stages.values import Values

if TYPE_CHECKING:
    from gsl_experiments.compare import Compare

TRIED = 2  # rollouts of π0 in each world, after one that compiles
LEARNED = 1.4  # how much longer a rollout takes with a learned grounding
APART = 25.0  # of a learned grounding: fits and checks [s]
FLOWN = {  # a second of motion in the air, on two cores [s]
    "diagnose": 7.5,
    "identify": 2.0,
    "servo": 1.0,
    "servo_on_effects": 1.0,
    "servo_members": 1.6,
    "servo_on_effects_members": 1.6,
}


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
        searched = iterate.optimizer.generations * iterate.optimizer.candidates * budget.rollouts
        measured = (iterate.optimizer.generations + 1) * budget.episodes + budget.check + 2 * budget.confirmation
    workers = threads(iterate.workers)
    sims = study.simulators or {"": iterate.sim}
    real = sum(_rollout(iterate, world, REAL) for world in study.worlds.values()) / len(study.worlds)
    sim = sum(_rollout(iterate, world, SIM) for world in sims.values()) / len(sims)
    collected = sum(budget.real), sum(budget.sim)
    rounds, worlds = iterate.iterations * len(study.worlds), len(study.worlds)
    flights = {name: parts for name, method in study.methods.items() if (parts := _flown(method))}
    rolled = fitted = 0.0
    for name, method in study.methods.items():
        apart = is_learned(method) or name in flights
        searches = rounds if apart else rounds - worlds + 1  # what knows no world searches first for all of them
        rolled += searches * searched * sim * (LEARNED if is_learned(method) else 1.0) + rounds * measured * real
        rolled += (worlds if apart else 1) * Values.count * sim if study.rank else 0.0
        if is_learned(method):
            further = rounds - worlds  # whose data are a method's own; in the first simulators with effects are
            rolled += further * collected[0] * real + (rounds if name in flights else further) * collected[1] * sim
            fitted += rounds * APART
    if any(map(is_learned, study.methods.values())):
        rolled += worlds * collected[0] * real + collected[1] * sim
    flown = len(iterate.diagnosis.excitation.motions) * iterate.diagnosis.excitation.duration if flights else 0.0
    fitted += worlds * flown * sum(FLOWN[part] for part in set(chain(*flights.values())))
    return (rolled / workers + fitted) * study.trials * len(sims)


def _flown(method: Grounding) -> tuple[str, ...]:
    """Return what a method makes of motions in the air."""
    diagnosed = (method.method,) if isinstance(method, DiagnosedEffects) and not method.effects else ()
    servo = innermost(method)
    if not isinstance(servo, LearnedServo):
        return diagnosed
    name = "servo_on_effects" if isinstance(method, DiagnosedEffects) else "servo"
    return (*diagnosed, f"{name}_members" if servo.ensemble else name)


def seconds_of_models(iterate: Iterate) -> float:
    """Return an estimate of how long an iteration's data and models take from nothing [s]."""
    real, sim = _rollout(iterate, iterate.real, REAL), _rollout(iterate, iterate.sim, SIM)
    rolled = sum(iterate.budget.real) * real + sum(iterate.budget.sim) * sim
    return rolled / threads(iterate.workers) + APART


def _rollout(iterate: Iterate, world: World, role: str) -> float:
    scenario = Scenario(world, iterate.task, iterate.policy, role, NoGrounding())
    env, parameters = scenario.make(), iterate.policy.initial
    rollout(scenario, env, parameters, 0)
    begin = time.process_time()
    for seed in range(TRIED):
        rollout(scenario, env, parameters, seed)
    env.close()
    return (time.process_time() - begin) / TRIED
