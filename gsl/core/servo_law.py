"""A learned servo law: what a servo does beyond its named parameters, as a correction of its torque.

For every joint at every physics step, in units of its torque limit L, with e_k the error of the target k lags ago:

    x       = (e_0 kp/L, ..., e_7 kp/L, v / SPEED_UNIT, act(SIGN v), bristle)
    drive   = sum_k lag_k x_k + out_0(x)      before the torque limit
    output  = out_1(x)                        behind it, as friction is
    out     = two hidden layers of 16, act(z) = z (27 + z²) / (27 + 9 z²) within +-3, a rational tanh

With `lag` and the last layer zero it is no correction at all. It works on floats and on lanes alike.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsl.core.compiled import compile_inner

LAGS = 8  # targets that the law sees, the newest included: 70 ms, beyond what servos lag behind
LAG = 0.01  # from one of them to the next [s]
HIDDEN = 16
INPUTS = LAGS + 3
LAYERS = 5  # rows of scratch: inputs, the two hidden layers before activation, and behind it
SPEED_UNIT = 4.0  # [rad/s]: usual speeds of a joint are then about 1
SIGN = 10.0  # [s/rad]: 0.1 rad/s is well in motion
NOBODY = -1  # group of a joint without a law
FIRST_BIAS, FIRST, SECOND_BIAS = 0, 1, 1 + INPUTS  # rows of the weights in one array: fewer arrays are passed on faster
SECOND, LAST, LAST_BIAS = SECOND_BIAS + 1, SECOND_BIAS + 1 + HIDDEN, SECOND_BIAS + 3 + HIDDEN
WEIGHTS = LAST_BIAS + 1  # how many these are


class ServoLaw(NamedTuple):
    """The law of n motors in G groups that share their weights.

    Attributes:
        group: Of each motor, NOBODY where there is no law, shape (n,).
        stiffness: kp/L, the unit of errors [1/rad], shape (n,).
        torque: L, the unit of torques [N·m], shape (n,).
        lag: Added share of kp at each lagged error, shape (n, LAGS).
        first, first_bias: Shapes (G, INPUTS, HIDDEN) and (G, HIDDEN).
        second, second_bias: Shapes (G, HIDDEN, HIDDEN) and (G, HIDDEN).
        last, last_bias: Shapes (G, HIDDEN, 2) and (G, 2); columns are drive and output.
    """

    group: np.ndarray
    stiffness: np.ndarray
    torque: np.ndarray
    lag: np.ndarray
    first: np.ndarray
    first_bias: np.ndarray
    second: np.ndarray
    second_bias: np.ndarray
    last: np.ndarray
    last_bias: np.ndarray


def no_law(motors: int) -> ServoLaw:
    """Return the law of servos that are what their parameters say."""
    none = np.zeros
    return ServoLaw(
        np.full(motors, NOBODY), none(motors), none(motors), none((motors, LAGS)), none((0, INPUTS, HIDDEN)),
        none((0, HIDDEN)), none((0, HIDDEN, HIDDEN)), none((0, HIDDEN)), none((0, HIDDEN, 2)), none((0, 2)),
    )  # fmt: skip


@compile_inner
def act(z: float) -> float:
    """Return the activation: tanh to 2 %, from products and one division, exactly 1 from 3 on."""
    z = min(3.0, max(-3.0, z))
    return z * (27.0 + z * z) / (27.0 + 9.0 * z * z)


def weights(law: ServoLaw) -> np.ndarray:
    """Return the networks as the kernel reads them, shape (G, WEIGHTS, HIDDEN); the last layer lies in two rows."""
    rows = np.zeros((len(law.first), WEIGHTS, HIDDEN))
    rows[:, FIRST_BIAS], rows[:, FIRST:SECOND_BIAS] = law.first_bias, law.first
    rows[:, SECOND_BIAS], rows[:, SECOND:LAST] = law.second_bias, law.second
    rows[:, LAST:LAST_BIAS], rows[:, LAST_BIAS, :2] = law.last.transpose(0, 2, 1), law.last_bias
    return rows


@compile_inner
def network(weights: np.ndarray, g: int, layers: np.ndarray) -> tuple[float, float]:
    """Return what group g's network adds before the torque limit and behind it, in torque limits.

    Args:
        weights: From `weights`.
        g: Group.
        layers: Row 0 holds the inputs; rows 1 and 2 become the hidden layers before activation, rows 3 and 4 behind it;
            shape (LAYERS, HIDDEN).
    """
    still = 0.0 * layers[0, 0]
    for h in range(HIDDEN):
        z = weights[g, FIRST_BIAS, h] + still
        for k in range(INPUTS):
            z += weights[g, FIRST + k, h] * layers[0, k]
        layers[1, h], layers[3, h] = z, act(z)
    for h in range(HIDDEN):
        z = weights[g, SECOND_BIAS, h] + still
        for k in range(HIDDEN):
            z += weights[g, SECOND + k, h] * layers[3, k]
        layers[2, h], layers[4, h] = z, act(z)
    drive, output = weights[g, LAST_BIAS, 0] + still, weights[g, LAST_BIAS, 1] + still
    for k in range(HIDDEN):
        drive += weights[g, LAST, k] * layers[4, k]
        output += weights[g, LAST + 1, k] * layers[4, k]
    return drive, output
