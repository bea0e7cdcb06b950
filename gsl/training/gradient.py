"""The derivatives of a replay's cost by a learned servo's numbers and law, summed over windows and lanes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsl.core.compiled import compile_kernel
from gsl.core.lanes import zeros_in_lanes
from gsl.core.servo_law import HIDDEN, INPUTS, LAGS

(BY_KP, BY_KD, BY_LIMIT, BY_DELAY, BY_COULOMB, BY_VISCOUS, BY_DEADBAND, BY_ARMATURE, BY_OFFSET) = range(9)
NUMBERS = 9  # kp, kd and limit as logarithms, then [s], [N·m], [N·m·s/rad], [rad], [kg·m²], [rad]


class Gradient(NamedTuple):
    """Derivatives of the cost, as floats or as lanes, for n motors in G groups.

    Attributes:
        numbers: By the servo's numbers, in the rows of NUMBERS, shape (NUMBERS, n).
        lag: And the rest, by the fields of `ServoLaw`, in their shapes.
    """

    numbers: np.ndarray
    lag: np.ndarray
    first: np.ndarray
    first_bias: np.ndarray
    second: np.ndarray
    second_bias: np.ndarray
    last: np.ndarray
    last_bias: np.ndarray


@compile_kernel
def sums_in_lanes(motors: int, groups: int) -> Gradient:
    """Return zeros to sum up derivatives in, each array with an axis of lanes in the end."""
    g = groups
    return Gradient(
        zeros_in_lanes(NUMBERS, motors), zeros_in_lanes(motors, LAGS),
        zeros_in_lanes(g, INPUTS * HIDDEN).reshape((g, INPUTS, HIDDEN, -1)), zeros_in_lanes(g, HIDDEN),
        zeros_in_lanes(g, HIDDEN * HIDDEN).reshape((g, HIDDEN, HIDDEN, -1)), zeros_in_lanes(g, HIDDEN),
        zeros_in_lanes(g, HIDDEN * 2).reshape((g, HIDDEN, 2, -1)), zeros_in_lanes(g, 2),
    )  # fmt: skip


@compile_kernel
def add_lanes(to: Gradient, sums: Gradient, lanes: int) -> None:
    """Add the derivatives of the first lanes; a lane in which a single one is no finite number gives none."""
    for lane in range(lanes):
        if not _finite(sums, lane):
            continue
        to.numbers[:] += sums.numbers[..., lane]
        to.lag[:] += sums.lag[..., lane]
        to.first[:] += sums.first[..., lane]
        to.first_bias[:] += sums.first_bias[..., lane]
        to.second[:] += sums.second[..., lane]
        to.second_bias[:] += sums.second_bias[..., lane]
        to.last[:] += sums.last[..., lane]
        to.last_bias[:] += sums.last_bias[..., lane]


@compile_kernel
def _finite(sums: Gradient, lane: int) -> bool:
    return (
        np.isfinite(sums.numbers[..., lane]).all()
        and np.isfinite(sums.lag[..., lane]).all()
        and np.isfinite(sums.first[..., lane]).all()
        and np.isfinite(sums.first_bias[..., lane]).all()
        and np.isfinite(sums.second[..., lane]).all()
        and np.isfinite(sums.second_bias[..., lane]).all()
        and np.isfinite(sums.last[..., lane]).all()
        and np.isfinite(sums.last_bias[..., lane]).all()
    )
