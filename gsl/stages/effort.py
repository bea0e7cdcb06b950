"""How long an iteration takes: the links that it builds, their rollouts, and the clock of a few rollouts of π0."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from gsl.core.interfaces import REAL, SIM, Grounding, Search, World
from gsl.core.words import duration, several
from gsl.core.workload import Part
from gsl.grounding.effects import DiagnosedEffects, evidence_of, innermost, is_learned
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.none import NoGrounding
from gsl.grounding.servo import LearnedServo
from gsl.rollout.estimate import measure_rollout
from gsl.rollout.parallel import threads
from gsl.rollout.rollout import Scenario
from gsl.worlds.external import ExternalRobot

if TYPE_CHECKING:
    from gsl.stages.iterate import Iterate

ROLLOUT = 0.3  # of a walk of 7.5 s on one core, where none is tried [s]
STEP = 0.0003  # of TRPO with its network, CPU time in the hopper and the cheetah [s]
LONG = 60.0  # what takes less is begun without a word: a rollout of each world takes seconds to load [s]
LEARNED = 1.4  # how much longer a rollout takes with a learned grounding
APART = 25.0  # of a learned grounding: fits and checks [s]
FLOWN = {  # a second of motion in the air, on two cores [s]
    "diagnose": 2.5,
    "identify": 2.0,
    "servo": 1.0,
    "servo_on_effects": 1.0,
    "servo_members": 1.6,
    "servo_on_effects_members": 1.6,
}


def foresee(iterate: Iterate) -> tuple[list[Part], str]:
    """Return the links that an iteration builds at most, and a line on how long they take; none if that is short."""
    parts = links(iterate)
    if sum(part.seconds for part in parts) < LONG or not isinstance(iterate.optimizer, Search):
        return parts, ""
    sim = seconds_of_rollout(iterate, iterate.sim, SIM)
    real = 0.0 if isinstance(iterate.real, ExternalRobot) else seconds_of_rollout(iterate, iterate.real, REAL)
    parts = links(iterate, sim, real)
    seconds = sum(part.seconds for part in parts)
    rounds = several(iterate.iterations, "iteration")
    walks = several(count_rollouts(iterate) * (iterate.iterations + iterate.beside + iterate.pretrained), "rollout")
    line = f"about {duration(seconds)} for {rounds} with {walks} of searches at most"
    return parts, f"{line}; a run that is stopped goes on where it was"


def links(iterate: Iterate, sim: float = ROLLOUT, real: float = ROLLOUT) -> list[Part]:
    """Return the links that an iteration builds at most, in their order, with rollouts of so many seconds."""
    budget, workers = iterate.budget, threads(iterate.workers)
    learned = is_learned(iterate.grounding)
    parts = [plan_search(iterate, sim)] if iterate.pretrained else []
    parts += _in_the_air(iterate)
    for _ in range(iterate.iterations):
        for role, count, each in ((REAL, sum(budget.real), real), (SIM, sum(budget.sim), sim)):
            if role in evidence_of(iterate.grounding):
                parts.append(Part(count * each / workers, count))
        if learned:
            models = 2 if isinstance(innermost(iterate.grounding), ActionTransformation) else 1
            parts += [Part(APART / models)] * models
        parts += [plan_search(iterate, sim * (LEARNED if learned else 1.0)), _measurement(iterate, real)]
    return parts + ([plan_search(iterate, sim), _measurement(iterate, real)] if iterate.beside else [])


def plan_search(iterate: Iterate, each: float) -> Part:
    """Return a search whose rollouts take `each` [s] as a part of planned work."""
    count, generations = count_rollouts(iterate), iterate.optimizer.generations
    if isinstance(iterate.optimizer, Search):
        return Part(count * each / threads(iterate.workers), count + generations * iterate.budget.screening_episodes)
    return Part(count * STEP + generations * iterate.budget.rollouts * each, count)


def count_rollouts(iterate: Iterate) -> int:
    """Return how many rollouts, or steps of a learner, a search plays at most."""
    optimizer = iterate.optimizer
    if isinstance(optimizer, Search):
        return optimizer.generations * optimizer.candidates * iterate.budget.rollouts
    return optimizer.steps_taken + optimizer.generations * iterate.budget.rollouts


def count_episodes(iterate: Iterate) -> int:
    """Return how many episodes a measurement takes, about."""
    budget = iterate.budget
    return (iterate.optimizer.generations + 1) * budget.episodes + budget.check + 2 * budget.confirmation


def flights(method: Grounding) -> tuple[str, ...]:
    """Return what a method makes of motions in the air, by its name in `FLOWN`."""
    diagnosed = (method.method,) if isinstance(method, DiagnosedEffects) and not method.effects else ()
    servo = innermost(method)
    if not isinstance(servo, LearnedServo):
        return diagnosed
    name = "servo_on_effects" if isinstance(method, DiagnosedEffects) else "servo"
    return (*diagnosed, f"{name}_members" if servo.ensemble else name)


def seconds_of_rollout(iterate: Iterate, world: World, role: str) -> float:
    """Return how long a rollout of π0 takes in a world [s]."""
    scenario = Scenario(world, iterate.task, iterate.policy, role, NoGrounding())
    return measure_rollout(scenario, iterate.policy.initial)


def _measurement(iterate: Iterate, each: float) -> Part:
    return Part(count_episodes(iterate) * each / threads(iterate.workers), count_episodes(iterate))


def _in_the_air(iterate: Iterate) -> Sequence[Part]:
    """Return the links of motions in the air: each is made of the same excitation, which is there after the first."""
    excitation, parts = iterate.diagnosis.excitation, list[Part]()
    for name in flights(iterate.grounding):
        count = 0 if parts else len(excitation.programme)
        seconds = FLOWN[name] * excitation.duration * len(excitation.motions)
        parts += [Part(count * ROLLOUT, count), Part(seconds, iterate.diagnosis.evaluations * (name == "identify"))]
    return parts
