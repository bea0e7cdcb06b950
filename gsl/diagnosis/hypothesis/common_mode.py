"""Common mode: what joints share in their calibration belongs to a cause that does the same to all of them.

A gain of 0.4 on all joints is also one of 0.3 and a calibration of 1.33 on each. Replays cannot tell, only the cost of
the calibration can, and a descent finds its way along such a valley slowly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gsl.diagnosis.hypothesis.candidates import Candidate
from gsl.diagnosis.simulate.calibration import COULOMB, KD, KP, OFFSET, VISCOUS, ZERO

ROWS = {
    ("servo_gain", "kp"): KP,
    ("servo_gain", "kd"): KD,
    ("coulomb_friction", "torque"): COULOMB,
    ("viscous_friction", "coefficient"): VISCOUS,
    ("zero_offset", "offset"): OFFSET,
    ("sensor_bias", "bias"): ZERO,
}
FACTORS = (KP, KD)  # rows that are logarithms of factors
TORQUES = (COULOMB, VISCOUS)


class Share(NamedTuple):
    """A parameter and the row of the calibration that does the same to the joints of its scope, shape (n_joints,).

    `unit` is what 1 of the row is of the parameter, where it is no factor.
    """

    parameter: int
    row: int
    joints: np.ndarray
    unit: float = 1.0


def shares(
    candidates: Sequence[Candidate], scopes: Mapping[str, np.ndarray], torque_unit: float = 1.0
) -> tuple[Share, ...]:
    """Return what parameters of candidates, in their order, share with the calibration of a robot."""
    parameters = [(candidate, name) for candidate in candidates for name in candidate.free]
    return tuple(
        Share(index, row, mask, torque_unit if row in TORQUES else 1.0)
        for index, (candidate, name) in enumerate(parameters)
        if (row := ROWS.get((candidate.effect, name))) is not None
        and (mask := _mask(candidate.fixed.get("joints"), scopes)) is not None
    )


def _mask(joints: str | Sequence[str] | None, scopes: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Return where an effect acts, a scope or a list of them, shape (n_joints,); None if that is no scope."""
    names = [joints] if isinstance(joints, str) else [*(joints or ())]
    if not names or any(name not in scopes for name in names):
        return None
    return np.any([scopes[name] for name in names], axis=0)


def hand_over(
    theta: np.ndarray, shifts: np.ndarray, bounds: np.ndarray, common: Sequence[Share]
) -> tuple[np.ndarray, np.ndarray]:
    """Return parameters, shape (p,), with what shifts, shape (7, n_joints), share, and the shifts without it."""
    theta, shifts = theta.copy(), shifts.copy()
    for k, row, joints, unit in common:
        mean, old = float(shifts[row, joints].mean()), theta[k]
        theta[k] = np.clip(old * np.exp(mean) if row in FACTORS else old + unit * mean, *bounds[:, k])
        shifts[row, joints] -= np.log(theta[k] / old) if row in FACTORS else (theta[k] - old) / unit
    return theta, shifts
