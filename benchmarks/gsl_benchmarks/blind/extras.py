"""Extras: torques at the joints that no effect of the library describes, for either generator.

cogging         amplitude sin(number q + phase)
cable_spring    -stiffness (q - slack) beyond the angle at which a cable at one joint is taut
warming         a share of the drive's torque, growing with the heat that past torque has left in the motor
bouc_wen        -torque z,  dz/dt = (v - |v| z |z|) / yielding      (Bouc 1967, Wen 1976; beta = gamma, n = 2)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from gsl.core.compiled import compile_kernel
from gsl.core.plant import Plant

COGGING, NUMBER, PHASE, SPRING, SLACK, SIDE, SHARE, HOT, BOUC, YIELDING = range(10)  # rows of the parameters
HEAT, HYSTERESIS = range(2)  # rows of the state
HEATING = 20.0  # time constant of a motor's heat [s]: an estimate, so that a log of a minute shows it
HALF = 0.5  # share of the torque limit that, held, takes away `share` of a motor's torque
LEAST = 0.2  # of a hot motor's torque


class Extra(NamedTuple):
    """What is drawn of an extra.

    Attributes:
        strength: The parameter that is dialled.
        most: Its greatest value.
        shapes: Ranges of the others.
        alone: Whether it acts on one joint only.
    """

    strength: str
    most: float
    shapes: Mapping[str, tuple[float, float]]
    alone: bool = False


EXTRAS: Mapping[str, Extra] = {
    "cogging": Extra("amplitude", 1.5, {"number": (12.0, 40.0), "phase": (0.0, 6.28)}),
    "cable_spring": Extra("stiffness", 40.0, {"slack": (-0.1, 0.05), "side": (-1.0, 1.0)}, alone=True),
    "warming": Extra("share", 0.9, {}),
    "bouc_wen": Extra("torque", 1.5, {"yielding": (0.03, 0.15)}),
}


def extra_rows(plant: Plant, extra: Mapping[str, Any] | None) -> np.ndarray:
    """Return an extra as the kernel reads it, shape (10, n_motors); without one, rows that do nothing.

    Args:
        plant: Whose joints its scope names; a cable is taut beyond `slack` [rad] from the rest.
        extra: Its `effect`, `joints` and parameters.
    """
    rows = np.zeros((10, len(plant.robot.motors)))
    limit = plant.servo.limit
    rows[YIELDING], rows[SIDE], rows[HOT] = 1.0, 1.0, HALF * np.where(np.isfinite(limit), limit, 1.0)
    if extra is None:
        return rows
    mask = plant.mask(extra["joints"])
    places = {"amplitude": COGGING, "number": NUMBER, "stiffness": SPRING, "share": SHARE, "torque": BOUC}
    for key, row in places.items():
        rows[row] = np.where(mask, extra.get(key, 0.0), 0.0)
    rows[PHASE] = extra.get("phase", 0.0) + np.arange(len(mask))
    rows[YIELDING] = extra.get("yielding", 1.0)
    rows[SIDE] = 1.0 if extra.get("side", 1.0) > 0.0 else -1.0
    rows[SLACK] = extra.get("slack", 0.0)
    return rows


@compile_kernel
def extra_torque(
    rows: np.ndarray, state: np.ndarray, rest: np.ndarray, motion: np.ndarray, drive: np.ndarray, step: float,
    torque: np.ndarray,
) -> None:  # fmt: skip
    """Add the extras' torques [N·m] to those at the outputs and move their state on by one step.

    Args:
        rows: From `extra_rows`.
        state: Heat and hysteresis, shape (2, n_motors), changed in place.
        rest: Angles about which a cable hangs slack [rad], shape (n_motors,).
        motion: Positions [rad] and velocities [rad/s] at the outputs, shape (2, n_motors).
        drive: Torques of the motors [N·m], shape (n_motors,).
        step: Physics period [s].
        torque: Shape (n_motors,), added to.
    """
    for i in range(motion.shape[1]):
        q, v = motion[0, i], motion[1, i]
        torque[i] += rows[COGGING, i] * np.sin(rows[NUMBER, i] * q + rows[PHASE, i])
        beyond = rows[SIDE, i] * (q - rest[i]) - rows[SLACK, i]
        torque[i] -= rows[SIDE, i] * rows[SPRING, i] * max(0.0, beyond)
        warm = (drive[i] / rows[HOT, i]) ** 2
        state[HEAT, i] += step / HEATING * (warm - state[HEAT, i])
        torque[i] -= min(1.0 - LEAST, rows[SHARE, i] * state[HEAT, i]) * drive[i]
        z = state[HYSTERESIS, i]
        z += step / rows[YIELDING, i] * (v - abs(v) * z * abs(z))
        state[HYSTERESIS, i] = min(1.0, max(-1.0, z))
        torque[i] -= rows[BOUC, i] * state[HYSTERESIS, i]
