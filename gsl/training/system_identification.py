"""System identification as it is usual: one value of every parameter for all joints, all of them fitted at once.

CMA-ES within the documented ranges on windowed replays, as in Bjelonic et al.: Towards bridging the gap (PACE, 2025).
What the library lacks, and what differs from joint to joint, is absorbed by whatever comes nearest. Play is not among
what is fitted: with the least of it come the spring of its teeth and a second mass, a step over which a search of all
strengths at once does not find back.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gsl.diagnosis.hypothesis.candidates import Candidate, effects_of
from gsl.diagnosis.hypothesis.problem import Problem
from gsl.diagnosis.log.residual import loss
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.in_the_air import Effects
from gsl.diagnosis.simulate.simulator import Bench
from gsl.optimizers.box_search import box_search

LEFT_OUT = ("action_noise", "encoder_noise", "joint_limit", "backlash")  # random, where hardly any log comes, play
SIGMA = 0.15  # first step, as a share of a range
CANDIDATES = 16  # of a generation; the usual 4 + 3 ln(n) is 13 for 20 parameters


class System(NamedTuple):
    """A fit of the library.

    Attributes:
        candidates: Of one parameter each, k of them.
        values: Of their parameters, shape (k,).
    """

    candidates: tuple[Candidate, ...]
    values: np.ndarray

    @property
    def effects(self) -> Effects:
        """An `effects:` mapping with all of them."""
        return effects_of(self.candidates, [np.array([value]) for value in self.values])


def identify(problem: Problem, *, evaluations: int, seed: int, tick: Callable[[], None]) -> System:
    """Fit all strengths that act on joints to half of the training windows; no fit is worse than none of them.

    Args:
        problem: Whose library and windows.
        evaluations: Replays of these windows.
        seed: Of the search.
        tick: Called after every replay.
    """
    chosen = tuple(c for c in problem.library if len(c.free) == 1 and c.on_joints and c.effect not in LEFT_OUT)
    start = np.array([candidate.neutral[0] for candidate in chosen])
    low, high = np.array([candidate.documented[:, 0] for candidate in chosen]).T
    generations = max(1, evaluations // CANDIDATES)
    search = box_search(start, low, high, seed, candidates=CANDIDATES, generations=generations, sigma=SIGMA)
    bench, best = problem.glance, start
    least = _cost(bench, System(chosen, start))
    for _ in range(generations):
        asked, costs = search.ask(), []
        for values in asked:
            costs.append(_cost(bench, System(chosen, values)))
            tick()
        search.tell([-cost for cost in costs])
        if min(costs) < least:
            best, least = asked[int(np.argmin(costs))], min(costs)
    return System(chosen, best)


def _cost(bench: Bench, system: System) -> float:
    return float(loss(bench.residual(system.effects, no_shifts(bench.joints))).sum())
