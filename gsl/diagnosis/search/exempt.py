"""Joints that a cause of many joints leaves out: there the calibration undoes what the cause does."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from gsl.diagnosis.hypothesis.common_mode import FACTORS, Share, shares
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis
from gsl.diagnosis.hypothesis.problem import Problem
from gsl.diagnosis.search.zeros import SHIFTS
from gsl.diagnosis.simulate.calibration import SPREADS

UNDONE = 0.5  # share of what a cause does to a joint, from which on the joint is no part of it
FEWEST = 2  # joints that are left: single ones are candidates anyhow


class Exemption(NamedTuple):
    """A cause of a hypothesis without some of its joints.

    Attributes:
        place: Of the cause in the hypothesis.
        joints: That are left: their scope, or a list.
        shifts: That leave all joints as they are, shape (7, n_joints).
    """

    place: int
    joints: str | Sequence[str]
    shifts: np.ndarray


def list_exemptions(problem: Problem, hypothesis: Hypothesis) -> Iterator[Exemption]:
    """Yield the causes of a hypothesis whose work the calibration undoes in some joints, zeros aside: see `zeros`."""
    robot, size = problem.simulator.plant.robot, problem.simulator.spread * SPREADS
    for place, (candidate, values) in enumerate(hypothesis.pairs):
        own = shares([candidate], problem.scopes, robot.torque_unit) if candidate.effect not in SHIFTS else ()
        works = [_work(share, values, candidate.neutral) for share in own]
        for share, work in zip(own, works, strict=True):
            undone = share.joints & (-np.sign(work) * hypothesis.fit.shifts[share.row] > UNDONE * abs(work))
            left = share.joints & ~undone
            if abs(work) > size[share.row] and undone.any() and left.sum() >= FEWEST:
                shifts = hypothesis.fit.shifts.copy()
                for each, does in zip(own, works, strict=True):
                    shifts[each.row, undone] += does
                names = [name for name, mask in problem.scopes.items() if np.array_equal(mask, left)]
                yield Exemption(place, names[0] if names else list(np.array(robot.controlled)[left]), shifts)


def _work(share: Share, values: np.ndarray, neutral: np.ndarray) -> float:
    """Return what a parameter does, in units of the shift that does the same."""
    value, nothing = values[share.parameter], neutral[share.parameter]
    return float(np.log(value / nothing) if share.row in FACTORS else (value - nothing) / share.unit)
