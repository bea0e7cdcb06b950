"""Pairs of effects that are looked for together, where joints shake.

One effect alone ends where it shakes a joint as much as the log. That is far from its value beside the other one: a
late measurement shakes a damped joint less. From there no descent leads to the pair.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gsl.diagnosis.hypothesis.candidates import Candidate, effects_of
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis
from gsl.diagnosis.hypothesis.problem import Ask, Problem
from gsl.diagnosis.log.log import spread
from gsl.diagnosis.search.screening import Ground, Lead, screen_candidates


def fit_pairs(problem: Problem, candidate: Candidate, count: int) -> list[Hypothesis]:
    """Fit the best pairs of an effect, at any value of its grid, and another one.

    Args:
        problem: Where they compete.
        candidate: The first effect; one without a grid has no pairs.
        count: How many are fitted, each with another second effect.
    """
    best: dict[str, tuple[np.ndarray, Lead]] = {}
    for values, lead in _screen(problem, candidate):
        effect = lead.candidate.effect
        if effect not in best or lead.cost < best[effect][1].cost:
            best[effect] = values, lead
    return problem.fit_all(
        [
            Ask((candidate, lead.candidate), np.r_[values, lead.parameters], lead.shifts)
            for values, lead in sorted(best.values(), key=lambda pair: pair[1].cost)[:count]
        ]
    )


def _screen(problem: Problem, candidate: Candidate) -> Iterator[tuple[np.ndarray, Lead]]:
    """Screen the other effects on top of each value of an effect's grid that one of them may still make good."""
    bench, settings, others = problem.glance, problem.settings, problem.without((candidate.effect,)).library
    count = len(bench.pieces)
    bench = replace(
        bench, pieces=bench.pieces.take(spread(np.arange(count), (count + 1) // 2))
    )  # a coarse look is enough
    far = settings.too_far * Ground.of(bench, {}).costs.sum()
    for values in candidate.grid[spread(np.arange(len(candidate.grid)), settings.values)]:
        ground = Ground.of(bench, effects_of((candidate,), (values,)))
        if ground.costs.sum() < far:
            seen = problem.memory.setdefault(("pairs", repr(ground.effects)), {})
            screening = screen_candidates(ground, others, problem.scopes, problem.tick, settings, seen)
            yield from ((values, lead) for lead in screening.leads)
