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

from gsl.diagnosis import nuisance
from gsl.diagnosis.attribute import Arena
from gsl.diagnosis.candidates import Candidate, switched_on
from gsl.diagnosis.replay import Bench, Effects
from gsl.diagnosis.residual import loss
from gsl.optimizers.box_search import box_search

LEFT_OUT = ("action_noise", "encoder_noise", "joint_limit", "backlash")  # random, where hardly any log comes, play
SIGMA = 0.15  # first step, as a share of a range
CANDIDATES = 16


class Identified(NamedTuple):
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
        return switched_on(self.candidates, [np.array([value]) for value in self.values])


def identified(arena: Arena, *, evaluations: int, seed: int, tick: Callable[[], None]) -> Identified:
    """Fit all strengths that act on joints to half of the training windows; no fit is worse than none of them.

    Args:
        arena: Whose library and windows.
        evaluations: Replays of these windows.
        seed: Of the search.
        tick: Called after every replay.
    """
    chosen = tuple(one for one in arena.library if len(one.free) == 1 and one.on_joints and one.effect not in LEFT_OUT)
    start, (low, high) = (
        np.array([one.neutral[0] for one in chosen]),
        np.array([one.documented[:, 0] for one in chosen]).T,
    )
    generations = max(1, evaluations // CANDIDATES)
    search = box_search(start, low, high, seed, candidates=CANDIDATES, generations=generations, sigma=SIGMA)
    bench, best = arena.glance, start
    least = _cost(bench, Identified(chosen, start))
    for _ in range(generations):
        asked, costs = search.ask(), []
        for values in asked:
            costs.append(_cost(bench, Identified(chosen, values)))
            tick()
        search.tell([-cost for cost in costs])
        if min(costs) < least:
            best, least = asked[int(np.argmin(costs))], min(costs)
    return Identified(chosen, best)


def _cost(bench: Bench, tried: Identified) -> float:
    return float(loss(bench.residual(tried.effects, nuisance.none(bench.joints))).sum())
