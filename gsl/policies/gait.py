"""One control step of the walk engine, compiled: requests, clock and feet in, joint targets out.

`values` are the 15 parameters of the paper's Table 1 in its order (the rows below). Six are inert in a straight walk:
max_left, max_turn, max_left_change, max_turn_change, left_extra_foot_height, and pendulum_height, which in the public
releases of the engine feeds only a diagnostic model.

Compiled or not it gives the same bits (a robot's runner has no compiler), so squares are products: Python rounds x**2
otherwise.
"""

from __future__ import annotations

import math

import numpy as np

from gsl.core.compiled import compile_kernel
from gsl.robots.nao import FOOT_HEIGHT, HIP_OFFSET_Y
from gsl.robots.nao_legs import leg_angles

(COM_OFFSET, PERIOD, HIP_HEIGHT, MAX_FORWARD, MAX_LEFT, MAX_TURN, FORWARD_CHANGE, LEFT_CHANGE, TURN_CHANGE,
 LIFT, ARM_SWING, PENDULUM, FORWARD_LIFT, LEFT_LIFT, START_DIVISOR) = range(15)  # fmt: skip

# rows of the state: clock [s], which leg swings (+1 left, -1 right), 0 in the priming step or 1, the ratcheted request
# (3), filtered pitch rate [rad/s], last centre of pressure [m], feet ahead of the hips [m] (left, right), leg opening
# [rad], yaw of each leg [rad], and these four as they were when the step began
CLOCK, SWING, WALKING, FORWARD, LEFT, TURN, GYRO, PRESSURE, FEET, BEGAN, SIZE = 0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16
X_LEFT, X_RIGHT, OPENING, YAW = range(4)

GYRO_GAIN = 1.0 / 25.0  # ankle pitch per pitch rate [s]: the release's constant
GYRO_TIME_CONSTANT = 0.045  # [s]: weights .8 and .2 at 100 Hz
LEFT_CALIBRATION, TURN_CALIBRATION = 0.82, 1.43  # the release's, requested to measured
EXTRA_PERIOD = 0.05  # how much longer a step at the full sideways request takes [s]
SHOULDER_ROLL = math.radians(7.0)


@compile_kernel
def first_state() -> np.ndarray:
    """Return the state before the priming step, in which the left foot is lifted a little."""
    state = np.zeros(SIZE)
    state[SWING] = 1.0
    return state


@compile_kernel
def step(values: np.ndarray, state: np.ndarray, request: np.ndarray, sensed: np.ndarray, period: float) -> np.ndarray:
    """Move `state` on by one control period and return the joint targets.

    Args:
        values: Parameters, shape (15,).
        state: Changed in place, shape (SIZE,).
        request: Forward [m/s], left [m/s], turn [rad/s], shape (3,).
        sensed: Pitch rate [rad/s], force on the left and on the right foot [N], shape (3,).
        period: Control period [s].

    Returns:
        Desired joint positions in the order of nao.CONTROLLED [rad], shape (15,).
    """
    duration = values[PERIOD] + EXTRA_PERIOD * abs(state[LEFT]) / max(abs(values[MAX_LEFT]), 1e-6)
    if _weight_has_shifted(state, sensed, duration):
        _begin_step(values, state, request)
    state[CLOCK] += period
    s = state[CLOCK] / duration
    forward = 2.0 * duration * state[FORWARD]  # strides: two steps [m], [m], [rad]
    left = 2.0 * duration * state[LEFT] * LEFT_CALIBRATION
    turn = 2.0 * duration * state[TURN] * TURN_CALIBRATION
    _move_feet(values, state, forward, left, turn, s)
    lift = values[LIFT] + abs(forward) * values[FORWARD_LIFT] + abs(left) * values[LEFT_LIFT]
    if state[WALKING] == 0.0:
        lift /= max(values[START_DIVISOR], 1.0)
    keep = math.exp(-period / GYRO_TIME_CONSTANT)
    state[GYRO] = keep * state[GYRO] + (1.0 - keep) * sensed[0]
    return _targets(values, state, lift * lift_profile(s))


@compile_kernel
def ramp(u: float) -> float:
    """Acceleration-limited ramp from 0 to 1."""
    u = min(1.0, max(0.0, u))
    return 2.0 * u * u if u < 0.5 else 1.0 - 2.0 * ((1.0 - u) * (1.0 - u))


@compile_kernel
def lift_profile(s: float) -> float:
    """Height of the swing foot over the step, 0 to 1 and back."""
    return ramp(2.0 * s) if s < 0.5 else ramp(2.0 - 2.0 * s)


@compile_kernel
def crouch(values: np.ndarray) -> np.ndarray:
    """Return the joint positions of both feet under the hips at walking height [rad], shape (15,)."""
    return _targets(values, first_state(), 0.0)


@compile_kernel
def _weight_has_shifted(state: np.ndarray, sensed: np.ndarray, duration: float) -> bool:
    """The centre of pressure changed sides late in the step, or the step takes far too long."""
    load = sensed[1] + sensed[2]
    before = state[PRESSURE]
    if load > 0.0:  # no contact is no sign
        state[PRESSURE] = HIP_OFFSET_Y * (sensed[1] - sensed[2]) / load
    changed = before * state[PRESSURE] < 0.0
    return (state[CLOCK] > 0.75 * duration and changed) or state[CLOCK] > 3.0 * duration


@compile_kernel
def _begin_step(values: np.ndarray, state: np.ndarray, request: np.ndarray) -> None:
    """The unloaded foot swings next; the request is followed by at most its change a step."""
    state[SWING] = 1.0 if state[PRESSURE] < 0.0 else -1.0
    state[CLOCK], state[WALKING] = 0.0, 1.0
    state[BEGAN:SIZE] = state[FEET:BEGAN]
    for axis in range(3):
        most, change = abs(values[MAX_FORWARD + axis]), abs(values[FORWARD_CHANGE + axis])
        wanted = min(most, max(-most, request[axis]))
        state[FORWARD + axis] = min(state[FORWARD + axis] + change, max(state[FORWARD + axis] - change, wanted))


@compile_kernel
def _move_feet(values: np.ndarray, state: np.ndarray, forward: float, left: float, turn: float, s: float) -> None:
    """Stance foot back at constant speed, swing foot ahead; legs open in the step of the leading foot, then close."""
    swing, stance = (X_LEFT, X_RIGHT) if state[SWING] > 0.0 else (X_RIGHT, X_LEFT)
    state[FEET + swing] = _between(state[BEGAN + swing], 0.25 * forward, ramp(s))
    state[FEET + stance] = _between(state[BEGAN + stance], -0.25 * forward, min(1.0, s))
    opening = math.atan(abs(left) / (values[HIP_HEIGHT] - FOOT_HEIGHT)) if left * state[SWING] > 0.0 else 0.0
    state[FEET + OPENING] = _between(state[BEGAN + OPENING], opening, ramp(s))
    yaw = 0.67 * abs(turn) if turn * state[SWING] > 0.0 else -0.33 * abs(turn)
    state[FEET + YAW] = _between(state[BEGAN + YAW], yaw, ramp(s))


@compile_kernel
def _between(start: float, end: float, share: float) -> float:
    return start + (end - start) * share


@compile_kernel
def _targets(values: np.ndarray, state: np.ndarray, lift: float) -> np.ndarray:
    targets = np.empty(15)
    targets[0] = -state[FEET + YAW] * math.sqrt(2.0)  # the shared axis is inclined: its yaw share is 1 / sqrt(2)
    height = values[HIP_HEIGHT] - FOOT_HEIGHT
    aside = height * math.tan(0.5 * state[FEET + OPENING])
    ankle, angles = np.empty(3), np.empty(5)
    for leg in range(2):
        side = 1.0 - 2.0 * leg
        swings = state[SWING] == side
        ankle[0] = state[FEET + leg] - values[COM_OFFSET]
        ankle[1] = side * aside
        ankle[2] = -(height - (lift if swings else 0.0))
        leg_angles(ankle, targets[0], side, angles)
        if not swings and state[CLOCK] > 0.0:
            angles[3] += GYRO_GAIN * state[GYRO]
        targets[1 + 5 * leg : 6 + 5 * leg] = angles
        targets[11 + 2 * leg] = 0.5 * math.pi + values[ARM_SWING] * state[FEET + leg]
        targets[12 + 2 * leg] = side * SHOULDER_ROLL
    return targets
