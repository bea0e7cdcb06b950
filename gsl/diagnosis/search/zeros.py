"""Zeros of many joints that are off to one side, which those of one make are not.

A calibration explains them as well as a cause does. So they gain nothing on residuals, and what a cause has to gain
elsewhere says nothing of them: what counts is how far the zeros of this robot spread.
"""

from __future__ import annotations

import numpy as np

from gsl.diagnosis.hypothesis.hypothesis import Hypothesis
from gsl.diagnosis.hypothesis.problem import Problem
from gsl.diagnosis.simulate.calibration import OFFSET, SPREADS, ZERO
from gsl.effects.effect import TWINS

SHIFTS = (*TWINS, *TWINS.values())  # effects that move a joint's zero


def zeros_aside(problem: Problem, standing: Hypothesis) -> bool:
    """Whether the zeros of a scope of many joints are off to one side."""
    return any(_is_aside(problem, standing, scope) for scope in _wide(problem))


def moves_zeros_alone(problem: Problem, hypothesis: Hypothesis, other: Hypothesis) -> bool:
    """Whether a hypothesis has nothing more than another one but zeros of many joints, and all that one has."""
    more = hypothesis.places - other.places
    zeros = other.places < hypothesis.places and all(effect in SHIFTS for effect, _ in more)
    return zeros and all(scope in _wide(problem) for _, scope in more)


def explains_zeros(problem: Problem, hypothesis: Hypothesis, other: Hypothesis) -> bool:
    """Whether the zeros that a hypothesis moves are off to one side where it does not, and it costs less."""
    more = hypothesis.places - other.places
    return hypothesis.cost < other.cost and all(_is_aside(problem, other, scope) for _, scope in more)


def _wide(problem: Problem) -> list[str]:
    return [scope for scope, mask in problem.scopes.items() if mask.sum() >= problem.settings.many]


def _is_aside(problem: Problem, standing: Hypothesis, scope: str) -> bool:
    mask, how = problem.scopes[scope], problem.settings
    usual = problem.simulator.spread * np.hypot(*SPREADS[[ZERO, OFFSET]])
    zeros = standing.fit.shifts[[ZERO, OFFSET]].sum(axis=0)
    mean = zeros[mask].mean()
    rest = float(((zeros - mean * mask) ** 2).sum())
    own = np.sqrt((how.like * usual**2 + rest) / (how.like + len(zeros) - 1))
    return bool(abs(mean) * np.sqrt(mask.sum()) > how.aside * own)
