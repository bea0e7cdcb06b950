"""Adjoints back through a learned servo law."""

from __future__ import annotations

import numpy as np

from gsl.core.compiled import compile_inner
from gsl.core.lanes import where
from gsl.core.servo import ROW
from gsl.core.servo_law import FIRST, HIDDEN, INPUTS, LAG, LAGS, LAST, NOBODY, SECOND, SIGN, SPEED_UNIT
from gsl.training.gradient import BY_DELAY, Gradient
from gsl.training.replay_path import POSITION, Moment
from gsl.training.servo_back import Adjoint, Work, slope_by_delay
from gsl.worlds.servo import BRISTLE, compute_wanted_torque
from gsl.worlds.servo_state import GROUP, LAG_SHARE, LAW_BENT, STIFFNESS, TORQUE, ServoParameters, ServoState


@compile_inner
def law_back(
    servos: ServoParameters, state: ServoState, now: Moment, adjoint: Adjoint, work: Work, to: Gradient
) -> None:
    """Pull the adjoints of what the law adds back through it.

    Args:
        servos: With the law.
        state: Of this control period; its scratch is filled anew.
        now: Physics step.
        adjoint: Its `error` and `moved` are added to, and the law's bristle is moved to the beginning of the step.
        work: Scratch.
        to: Added to.
    """
    rows, motion, before = servos.rows, now.motion, now.memory
    inputs, moved, held, length = work.inputs, adjoint.moved, adjoint.held, now.step / now.period
    for i in range(motion.shape[1]):
        if rows[GROUP, i] == NOBODY:
            continue
        by_u, still = adjoint.wanted[i], 0.0 * adjoint.wanted[i]
        state.memory[LAW_BENT, i] = before[LAW_BENT, i]
        q = now.seen[POSITION, i]
        compute_wanted_torque(servos, state, i, motion, still, q, still, now.elapsed, now.step, now.period)
        drive, output, g = rows[TORQUE, i] * by_u, rows[TORQUE, i] * adjoint.output[i], int(rows[GROUP, i])
        _network_back(servos.weights, g, drive, output, state.layers, inputs, work.hidden, to)
        for k in range(LAGS):
            start = (now.elapsed - rows[ROW.delay, i] - LAG * k) / now.period
            later = slope_by_delay(state.commands, i, start, length) / now.period
            share = rows[STIFFNESS, i] * (inputs[k] + drive * rows[LAG_SHARE + k, i])
            to.lag[i, k] += drive * state.layers[0, k]
            to.numbers[BY_DELAY, i] += share * later
            adjoint.error[i] += share
        moved[1, i] += inputs[LAGS] / SPEED_UNIT
        moved[1, i] += inputs[LAGS + 1] * SIGN * slope_of_act(SIGN * motion[1, i])
        bent = before[LAW_BENT, i] + now.step * motion[1, i]
        held[LAW_BENT, i] = where(abs(bent) < BRISTLE, inputs[LAGS + 2] / BRISTLE + held[LAW_BENT, i], 0.0)
        moved[1, i] += now.step * held[LAW_BENT, i]


@compile_inner
def _network_back(
    weights: np.ndarray, g: int, drive: float, output: float, layers: np.ndarray, inputs: np.ndarray,
    hidden: np.ndarray, to: Gradient,
) -> None:  # fmt: skip
    """Fill in the adjoints of group g's inputs and add to the gradient.

    Args:
        weights: From `servo_law.weights`.
        g: Group.
        drive: Adjoint of what the network adds before the limit.
        output: Adjoint of what it adds behind it.
        layers: See `servo_law.network`.
        inputs: Result, shape (HIDDEN,).
        hidden: Scratch, shape (2, HIDDEN).
        to: Added to.
    """
    to.last_bias[g, 0] += drive
    to.last_bias[g, 1] += output
    for h in range(HIDDEN):
        to.last[g, h, 0] += drive * layers[4, h]
        to.last[g, h, 1] += output * layers[4, h]
        back = weights[g, LAST, h] * drive + weights[g, LAST + 1, h] * output
        hidden[1, h] = slope_of_act(layers[2, h]) * back
        to.second_bias[g, h] += hidden[1, h]
    for k in range(HIDDEN):
        x, back = layers[3, k], 0.0 * drive
        for h in range(HIDDEN):
            to.second[g, k, h] += x * hidden[1, h]
            back += weights[g, SECOND + k, h] * hidden[1, h]
        hidden[0, k] = slope_of_act(layers[1, k]) * back
        to.first_bias[g, k] += hidden[0, k]
    for k in range(INPUTS):
        x, back = layers[0, k], 0.0 * drive
        for h in range(HIDDEN):
            to.first[g, k, h] += x * hidden[0, h]
            back += weights[g, FIRST + k, h] * hidden[0, h]
        inputs[k] = back


@compile_inner
def slope_of_act(z: float) -> float:
    """Return the derivative of `act`."""
    low = 27.0 + 9.0 * z * z
    inside = (27.0 + 3.0 * z * z) / low - 18.0 * z * z * (27.0 + z * z) / (low * low)
    return where(abs(z) < 3.0, inside, 0.0)
