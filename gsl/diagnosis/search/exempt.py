"""Joints that a cause of many joints leaves out: there the calibration undoes what the cause does."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from gsl.diagnosis.hypothesis.candidates import AND
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
        scope: Of the joints that are left.
        joints: These, shape (n_joints,).
        shifts: That leave all joints as they are, shape (7, n_joints).
    """

    place: int
    scope: str
    joints: np.ndarray
    shifts: np.ndarray


def list_exemptions(problem: Problem, hypothesis: Hypothesis) -> Iterator[Exemption]:
    """Yield the causes of a hypothesis whose work the calibration undoes in some joints, zeros aside: see `zeros`."""
    robot, size = problem.simulator.plant.robot, problem.simulator.spread * SPREADS
    for place, (candidate, values) in enumerate(hypothesis.pairs):
        for share in shares([candidate], problem.scopes, robot.torque_unit) if candidate.effect not in SHIFTS else ():
            work, shift = _work(share, values, candidate.neutral), hypothesis.fit.shifts[share.row]
            undone = share.joints & (-np.sign(work) * shift > UNDONE * abs(work))
            left = share.joints & ~undone
            if abs(work) > size[share.row] and undone.any() and left.sum() >= FEWEST:
                shifts = hypothesis.fit.shifts.copy()
                shifts[share.row, undone] += work
                yield Exemption(place, AND.join(np.array(robot.controlled)[left]), left, shifts)


def _work(share: Share, values: np.ndarray, neutral: np.ndarray) -> float:
    """Return what a parameter does, in units of the shift that does the same."""
    value, nothing = values[share.parameter], neutral[share.parameter]
    return float(np.log(value / nothing) if share.row in FACTORS else (value - nothing) / share.unit)
