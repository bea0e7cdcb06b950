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

from gsl.core.compiled import compiled

LAGS = 8  # targets that the law sees, the newest included: 70 ms, beyond what servos lag behind
LAG = 0.01  # from one of them to the next [s]
HIDDEN = 16
INPUTS = LAGS + 3
SPEED_UNIT = 4.0  # [rad/s]: usual speeds of a joint are then about 1
SIGN = 10.0  # [s/rad]: 0.1 rad/s is well in motion
NOBODY = -1  # group of a joint without a law


class ServoLaw(NamedTuple):
    """The law as the kernel reads it, for n motors in G groups that share their weights.

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


@compiled
def act(z: float) -> float:
    """Return the activation: tanh to 2 %, from products and one division, exactly 1 from 3 on."""
    z = min(3.0, max(-3.0, z))
    return z * (27.0 + z * z) / (27.0 + 9.0 * z * z)


@compiled
def correction(law: ServoLaw, i: int, layers: np.ndarray) -> tuple[float, float]:
    """Return the torques that motor i's law adds before the limit and behind it [N·m].

    Args:
        law: Of all motors.
        i: Motor.
        layers: Row 0 holds the inputs x; rows 1 and 2 are scratch for the hidden layers; shape (3, HIDDEN).
    """
    g, drive = law.group[i], 0.0 * layers[0, 0]
    for h in range(HIDDEN):
        layers[1, h] = law.first_bias[g, h] + 0.0 * drive
        layers[2, h] = law.second_bias[g, h] + 0.0 * drive
    for k in range(INPUTS):
        x = layers[0, k]
        for h in range(HIDDEN):
            layers[1, h] += law.first[g, k, h] * x
    for k in range(HIDDEN):
        x = act(layers[1, k])
        for h in range(HIDDEN):
            layers[2, h] += law.second[g, k, h] * x
    output = law.last_bias[g, 1] + 0.0 * drive
    drive += law.last_bias[g, 0]
    for k in range(HIDDEN):
        x = act(layers[2, k])
        drive += law.last[g, k, 0] * x
        output += law.last[g, k, 1] * x
    for k in range(LAGS):
        drive += law.lag[i, k] * layers[0, k]
    return law.torque[i] * drive, law.torque[i] * output
