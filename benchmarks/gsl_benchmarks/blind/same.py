"""The same generator: gsl's own servos and chain model at 0.5 ms, and the extras, as robots that play a programme."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gsl.core.compiled import compile_kernel
from gsl.core.plant import Plant
from gsl.core.servo_law import HIDDEN, LAYERS
from gsl.effects.effect import apply_all, build
from gsl.worlds.chain import COLUMNS, Chain, accelerate, nothing
from gsl.worlds.encoder import first_history
from gsl.worlds.held import Held
from gsl.worlds.servo import encoder_motion, servo_torque
from gsl.worlds.servo_state import COMMANDS, DRIVE, MEMORY, SMOOTHED, SPEED, ServoParameters, ServoState
from gsl_benchmarks.blind.extras import extra_rows, extra_torque

STEP = 0.0005  # physics period [s]: robots have none, and at 1 ms a delay is half of one longer
SETTLE = 25  # control periods for which the first command is held before a motion begins


def play_same(
    plant: Plant,
    effects: Mapping[str, Any],
    extra: Mapping[str, Any] | None,
    targets: Sequence[np.ndarray],
    starts: Sequence[np.ndarray],
    period: float,
) -> list[np.ndarray]:
    """Return what the encoders tell before each command and after the last one [rad], shape (T + 1, n_motors) each.

    Args:
        plant: The robot without the effects.
        effects: As a world's `effects:`.
        extra: Of `extras`, if there is one.
        targets: Of the motors [rad], shape (T, n_motors) each, played one after the other.
        starts: Positions before the first command is held [rad], shape (n_motors,) each.
        period: Control period [s].
    """
    held = Held.of(apply_all(plant, build(effects)), STEP, period)
    if extra is None:
        return held.play(targets, starts, SETTLE)
    rows, state = extra_rows(plant, extra), np.zeros((2, len(held.bias)))
    rest, paths = targets[0][0].copy(), []
    for path, start in zip(targets, starts, strict=True):
        older = np.vstack([np.repeat(path[:1], COMMANDS - 1 + SETTLE, axis=0), path])
        said = np.full((len(path) + SETTLE, len(start)), np.nan)
        motion = np.array([start, np.zeros_like(start)])
        newest_first = np.ascontiguousarray(older[::-1])
        _play(held.servo, held.tree, rows, state, rest, newest_first, motion, STEP, round(period / STEP), SETTLE, said)
        paths.append(said[SETTLE - 1 :] + held.bias)
    return paths


@compile_kernel
def _play(
    servo: ServoParameters, tree: Chain, rows: np.ndarray, extras: np.ndarray, rest: np.ndarray, commands: np.ndarray,
    motion: np.ndarray, step: float, substeps: int, settle: int, path: np.ndarray,
) -> None:  # fmt: skip
    periods, n = path.shape
    torque, work, matrix, pushed = np.zeros(n), np.zeros((n, COLUMNS)), np.zeros((n, n)), nothing()
    memory, encoders, steps = np.zeros((MEMORY, n)), np.zeros((2, n)), np.array([0, 1])
    clock = np.array([-settle * substeps * step])
    memory[1], memory[2], memory[SPEED], memory[SMOOTHED] = motion[0], motion[1], motion[1], commands[periods]
    history = first_history(motion, step)
    for t in range(periods):
        newest = commands[periods - 1 - t : periods - 1 - t + COMMANDS]
        state = ServoState(newest, memory, history, clock, steps, np.zeros((LAYERS, HIDDEN)))
        for k in range(substeps):
            servo_torque(servo, state, motion, k * step, step, substeps * step, torque)
            extra_torque(rows, extras, rest, motion, memory[DRIVE], step, torque)
            accelerate(tree, motion, pushed, torque, work, matrix)
            for i in range(n):
                motion[1, i] += step * torque[i]
                motion[0, i] += step * motion[1, i]
        encoder_motion(servo, state, motion, step, encoders)
        path[t] = encoders[0]
        clock[0] += substeps * step
