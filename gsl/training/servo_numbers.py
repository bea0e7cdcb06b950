"""The first step of learning a servo: its numbers, alike in a group, by least squares on replays in the chain model.

What a group's numbers do to other groups is left out of the derivatives, not of the replays: one replay a number probes
all groups, or for offsets all joints, at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import least_squares

from gsl.core.plant import Plant
from gsl.models.servo import NUMBERS, ServoModel

PROBE = 0.02  # of the finite differences, in units
ROBUST = 3.0  # residual beyond which one counts less and less [floors]
ROUNDS = 4  # in which the robust scale comes down to ROBUST
STEPS = 8  # of each round, at most
RIDGE = 0.02  # cost of a change by a unit, in residuals per sqrt(number of residuals)
FAR = 100.0  # floors beyond which a residual is cut off before it sets a scale


def fit_numbers(
    plant: Plant, model: ServoModel, residual: Callable[[ServoModel], np.ndarray], *,
    free: Sequence[str] = NUMBERS, ridge: float = RIDGE, longest: float = np.inf, rounds: int = ROUNDS,
) -> ServoModel:  # fmt: skip
    """Return the model with the numbers that replay a log best.

    Args:
        plant: The servo that the model stands on.
        model: Where to begin.
        residual: Of a model's replays, in floors, shape (W, scored, n_joints); joints come first among the motors.
        free: Names of the numbers that are fitted.
        ridge: Cost of a change by a unit, in residuals per sqrt(number of residuals).
        longest: Delay of the target that a simulator can remember [s].
        rounds: In which the robust scale comes down; one is enough near the answer.
    """
    joints = len(plant.robot.controlled)
    columns = _columns(model.group[:joints], free)

    def numbers(x: np.ndarray) -> ServoModel:
        return model.shift(plant, np.einsum("c,ckj->kj", x, columns)).within(plant, longest)

    def at(x: np.ndarray) -> np.ndarray:
        return residual(numbers(x)).reshape(-1, joints)

    x = np.zeros(len(columns))
    pull = ridge * np.sqrt(at(x).size) * np.eye(len(x))

    def cost(x: np.ndarray) -> np.ndarray:
        return np.r_[at(x).ravel(), pull @ x]

    def jacobian(x: np.ndarray) -> np.ndarray:
        return np.vstack([_slopes(at, x, columns), pull])

    for left in range(rounds - 1, -1, -1):
        far = np.sqrt(np.mean(np.minimum(np.abs(at(x)), FAR) ** 2))
        scale = ROBUST * max(1.0, far / ROBUST) ** (left / rounds)
        x = least_squares(cost, x, jacobian, loss="cauchy", f_scale=scale, max_nfev=STEPS, ftol=1e-3, xtol=1e-3).x
    return numbers(x)


def _columns(group: np.ndarray, free: Sequence[str]) -> np.ndarray:
    """Return which numbers each free one moves, shape (n_free, NUMBERS, n_joints): of a group, or a joint's offset."""
    rows = []
    for kind, name in enumerate(NUMBERS):
        if name not in free:
            continue
        masks = np.eye(len(group)) if name == "offset" else [group == g for g in np.unique(group)]
        for mask in masks:
            row = np.zeros((len(NUMBERS), len(group)))
            row[kind] = mask
            rows.append(row)
    return np.array(rows)


def _slopes(at: Callable[[np.ndarray], np.ndarray], x: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the derivatives of residuals, shape (n_residuals, n_free)."""
    base, kinds = at(x), columns.any(axis=2).argmax(axis=1)
    result = np.zeros((*base.shape, len(x)))
    for kind in np.unique(kinds):
        slope = (at(x + PROBE * (kinds == kind)) - base) / PROBE
        for column in np.flatnonzero(kinds == kind):
            result[..., column] = slope * columns[column, kind]
    return result.reshape(-1, len(x))
