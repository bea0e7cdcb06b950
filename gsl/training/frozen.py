"""Rigid-body terms along measured motion, from the chain model: what a replay of servos needs to know of the links."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsl.core.compiled import compile_kernel
from gsl.core.plant import Plant
from gsl.diagnosis.log.records import Pieces
from gsl.worlds.chain import COLUMNS, Chain, accelerate, chain, nothing
from gsl.worlds.servo_state import ROTOR, pack


class Frozen(NamedTuple):
    """Windows of a log with their rigid-body terms; W windows, T control periods, n motors, of which m are logged.

    Attributes:
        commands: Newest first, see `Windows`, shape (W, T + COMMANDS - 1, n), or three or five times as wide.
        motion: At the beginning [rad], [rad/s], shape (W, 2, n).
        clock: Time since the episode began, at the beginning [s], shape (W,).
        mobility: Inverse mass matrix in the middle of each period [1/(kg·m²)], shape (W, T, n, n).
        free: Acceleration without torque, there [rad/s²], shape (W, T, n).
        real: Measured after each period [rad], shape (W, T, m).
        floor: Noise floor [rad], shape (m,).
        bias: Of the logged positions [rad], shape (n,).
        warm_up: Periods at the beginning that are not scored.
    """

    commands: np.ndarray
    motion: np.ndarray
    clock: np.ndarray
    mobility: np.ndarray
    free: np.ndarray
    real: np.ndarray
    floor: np.ndarray
    bias: np.ndarray
    warm_up: int


def freeze(plant: Plant, pieces: Pieces, floor: np.ndarray, period: float) -> Frozen:
    """Return windows of a log with their rigid-body terms.

    Args:
        plant: The robot with its effects; held in the air.
        pieces: Windows; all of the robot's controlled joints are logged, coupled motors move as the joint they follow.
        floor: Noise floor [rad], shape (n_joints,).
        period: Control period [s].
    """
    windows, bias = pieces.windows, plant.sensors.bias
    path = np.concatenate([windows.motion[:, :1], pieces.real[:, :, plant.robot.drive]], axis=1) - bias
    speed = np.diff(path, axis=1) / period
    middle = np.ascontiguousarray(0.5 * (path[:, 1:] + path[:, :-1]))
    servo = pack(plant.servo, plant.robot.supply_voltage)
    tree = chain(plant, plant.servo.armature - servo.rows[ROTOR])
    mobility, free = np.empty((*middle.shape, middle.shape[2])), np.empty(middle.shape)
    _rigid_body(tree, middle, np.ascontiguousarray(speed), mobility, free)
    motion = windows.motion.copy()
    motion[:, 0] -= bias
    commands, real = (np.ascontiguousarray(path) for path in (windows.commands, pieces.real))
    return Frozen(commands, motion, windows.clock, mobility, free, real, floor, bias, pieces.warm_up)


@compile_kernel
def _rigid_body(tree: Chain, position: np.ndarray, speed: np.ndarray, mobility: np.ndarray, free: np.ndarray) -> None:
    """Fill in inverse mass matrices and accelerations without torque, one a period."""
    n = position.shape[2]
    motion, work, matrix, column = np.zeros((2, n)), np.zeros((n, COLUMNS)), np.zeros((n, n)), np.zeros(n)
    pushed = nothing()
    for w in range(position.shape[0]):
        for t in range(position.shape[1]):
            motion[0], motion[1] = position[w, t], speed[w, t]
            column[:] = 0.0
            accelerate(tree, motion, pushed, column, work, matrix)
            free[w, t] = column
            for j in range(n):
                column[:] = 0.0
                column[j] = 1.0
                accelerate(tree, motion, pushed, column, work, matrix)
                mobility[w, t, :, j] = column - free[w, t]


def heavier(data: Frozen, inertia: np.ndarray) -> Frozen:
    """Return the windows with more inertia E that moves with the outputs [kg·m²], shape (n,).

    (M + E)⁻¹ = (1 + M⁻¹ E)⁻¹ M⁻¹; of a rotor beyond play or a spring only a share moves with the output.
    """
    if not inertia.any():
        return data
    factor = np.linalg.inv(np.eye(len(inertia)) + data.mobility * inertia)
    free = (factor @ data.free[..., None])[..., 0]
    return data._replace(mobility=np.ascontiguousarray(factor @ data.mobility), free=np.ascontiguousarray(free))
