"""Adjoints back through a learned servo law."""

from __future__ import annotations

import numpy as np

from gsl.core.compiled import compiled
from gsl.core.lanes import where
from gsl.core.servo_law import HIDDEN, INPUTS, LAG, LAGS, NOBODY, SIGN, SPEED_UNIT, ServoLaw, act
from gsl.training.gradient import BY_DELAY, Gradient
from gsl.training.replay_path import POSITION, Moment
from gsl.training.servo_back import Adjoint, Work, slope_by_delay
from gsl.worlds.servo import BRISTLE, wanted_torque
from gsl.worlds.servo_state import DELAY, LAW_BENT, ServoParameters, ServoState


@compiled
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
    rows, law, motion, before = servos.rows, servos.law, now.motion, now.memory
    inputs, moved, held, length = work.inputs, adjoint.moved, adjoint.held, now.step / now.period
    for i in range(motion.shape[1]):
        if law.group[i] == NOBODY:
            continue
        by_u, still = adjoint.wanted[i], 0.0 * adjoint.wanted[i]
        state.memory[LAW_BENT, i] = before[LAW_BENT, i]
        q = now.seen[POSITION, i]
        wanted_torque(servos, state, i, motion, still, q, still, now.elapsed, now.step, now.period)
        adjoint.error[i] += _network_back(law, i, by_u, adjoint.output[i], state.layers, inputs, work.hidden, to)
        for k in range(LAGS):
            start = (now.elapsed - rows[DELAY, i] - LAG * k) / now.period
            later = slope_by_delay(state.commands, i, start, length) / now.period
            share = inputs[k] + law.torque[i] * by_u * law.lag[i, k]
            to.numbers[BY_DELAY, i] += law.stiffness[i] * share * later
        moved[1, i] += inputs[LAGS] / SPEED_UNIT
        moved[1, i] += inputs[LAGS + 1] * SIGN * slope_of_act(SIGN * motion[1, i])
        bent = before[LAW_BENT, i] + now.step * motion[1, i]
        held[LAW_BENT, i] = where(abs(bent) < BRISTLE, inputs[LAGS + 2] / BRISTLE + held[LAW_BENT, i], 0.0)
        moved[1, i] += now.step * held[LAW_BENT, i]


@compiled
def _network_back(
    law: ServoLaw, i: int, by_u: float, by_out: float, layers: np.ndarray, inputs: np.ndarray, hidden: np.ndarray,
    to: Gradient,
) -> float:  # fmt: skip
    """Fill in the adjoints of the inputs, add to the gradient, and return the adjoint of the control error.

    Args:
        law: Of all motors.
        i: Motor.
        by_u: Adjoint of its torque before the limit.
        by_out: Adjoint of its torque behind it.
        layers: What it saw and its hidden layers before activation, shape (3, HIDDEN).
        inputs: Result, shape (HIDDEN,).
        hidden: Scratch, shape (2, HIDDEN).
        to: Added to.
    """
    g, drive, output = law.group[i], law.torque[i] * by_u, law.torque[i] * by_out
    to.last_bias[g, 0] += drive
    to.last_bias[g, 1] += output
    for h in range(HIDDEN):
        x = act(layers[2, h])
        to.last[g, h, 0] += drive * x
        to.last[g, h, 1] += output * x
        hidden[1, h] = slope_of_act(layers[2, h]) * (law.last[g, h, 0] * drive + law.last[g, h, 1] * output)
        to.second_bias[g, h] += hidden[1, h]
    for k in range(HIDDEN):
        x, back = act(layers[1, k]), 0.0 * drive
        for h in range(HIDDEN):
            to.second[g, k, h] += x * hidden[1, h]
            back += law.second[g, k, h] * hidden[1, h]
        hidden[0, k] = slope_of_act(layers[1, k]) * back
        to.first_bias[g, k] += hidden[0, k]
    by_error = 0.0 * drive
    for k in range(INPUTS):
        x, back = layers[0, k], 0.0 * drive
        for h in range(HIDDEN):
            to.first[g, k, h] += x * hidden[0, h]
            back += law.first[g, k, h] * hidden[0, h]
        if k < LAGS:
            to.lag[i, k] += drive * x
            by_error += law.stiffness[i] * (back + drive * law.lag[i, k])
        inputs[k] = back
    return by_error


@compiled
def slope_of_act(z: float) -> float:
    """Return the derivative of `act`."""
    low = 27.0 + 9.0 * z * z
    inside = (27.0 + 3.0 * z * z) / low - 18.0 * z * z * (27.0 + z * z) / (low * low)
    return where(abs(z) < 3.0, inside, 0.0)
