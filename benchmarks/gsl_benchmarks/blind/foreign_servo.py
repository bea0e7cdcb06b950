"""Another servo than gsl's, compiled: an elastic drive train with the motor, its friction and its lags on one side.

    target      held command, delayed, filtered (implicit Euler), rounded
    u           kp fade (dead(target + offset - q)) - kd w        q the output's encoder, w its speed behind a filter
    motor       u within the limit and the speed line, behind the lag of a current loop
    rotor       J dω/dt = motor - viscous ω - dry friction - gear
    gear        stiffness (rotor - q) + damping (ω - v), beyond half the play; teeth do not pull
    output      gear - hard stops

Dry friction is LuGre's (Canudas de Wit 1995) with the deflection z in units of its breakaway, so that its size may
change with load and speed: friction = size z + micro damping dz/dt,  dz/dt = (v - |v| z) / breakaway.
"""

from __future__ import annotations

import numpy as np

from gsl.core.compiled import compile_kernel

(
    KP, KD, LIMIT, NO_LOAD, COULOMB, VISCOUS, STRIBECK, STRIBECK_SPEED, LOAD, ROTOR, DELAY, SMOOTHING, QUANTUM,
    DEADBAND, PLAY, SOFTNESS, SAG, DUTY_LOSS, FADE, OFFSET, AGE, LOWER, UPPER, PER_AMPERE,
) = range(24)  # rows of the parameters  # fmt: skip
ANGLE, OMEGA, BENT, FILTERED, MOTOR, GEAR, SLOW = range(7)  # rows of the state
GEAR_STIFFNESS, GEAR_DAMPING = 2000.0, 0.3  # [N·m/rad]; share of sqrt(stiffness · rotor inertia)
BREAKAWAY, MICRO = 4e-4, 0.3  # deflection at which dry friction gives way [rad]; share of its critical damping
CURRENT_LAG, SPEED_LAG = 1e-3, 1e-3  # time constants of the current loop and of the speed's filter [s]
STOP, STOP_DAMPING = 800.0, 3.0  # of a hard stop [N·m/rad], [N·m·s/rad]
REMEMBERED = 256  # physics steps of encoder readings
SUBSTEPS = 4  # of the drive train


@compile_kernel
def foreign_torque(
    p: np.ndarray, state: np.ndarray, ring: np.ndarray, count: int, motion: np.ndarray, wanted: np.ndarray,
    time: float, step: float, torque: np.ndarray,
) -> None:  # fmt: skip
    """Fill `torque` [N·m] at the outputs for one physics step and move the state on.

    Args:
        p: Parameters, shape (24, n_motors).
        state: Shape (7, n_motors).
        ring: Encoder readings of past steps, shape (REMEMBERED, 2, n_motors).
        count: Physics steps so far.
        motion: Positions [rad] and velocities [rad/s] at the outputs, shape (2, n_motors).
        wanted: Delayed commands [rad], shape (n_motors,).
        time: Since the episode began [s].
        step: Physics period [s].
        torque: Result, shape (n_motors,).
    """
    current = 0.0
    for i in range(motion.shape[1]):
        current += abs(state[MOTOR, i]) * p[PER_AMPERE, i]
    for i in range(motion.shape[1]):
        q, v = measure_late(p, ring, count, motion, i, step)
        state[SLOW, i] += step / (SPEED_LAG + step) * (v - state[SLOW, i])
        state[FILTERED, i] += step / (p[SMOOTHING, i] + step) * (wanted[i] - state[FILTERED, i])
        target = state[FILTERED, i]
        if p[QUANTUM, i] > 0.0:
            target = p[QUANTUM, i] * np.floor(target / p[QUANTUM, i] + 0.5)
        error = target + p[OFFSET, i] - q
        error = np.sign(error) * max(0.0, abs(error) - p[DEADBAND, i])
        u = p[KP, i] * max(0.0, 1.0 - p[FADE, i] * max(0.0, time)) * error - p[KD, i] * state[SLOW, i]
        limit = p[LIMIT, i]
        if p[DUTY_LOSS, i] > 0.0:
            duty = min(1.0, max(-1.0, u / limit))
            u = limit * duty * (1.0 - p[DUTY_LOSS, i] * abs(duty))
        supply = max(1e-3, 1.0 - p[SAG, i] * current)
        room = limit * supply * min(1.0, max(0.0, 1.0 - abs(state[OMEGA, i]) / (supply * p[NO_LOAD, i])))
        driving = u * state[OMEGA, i] > 0.0
        bound = room if driving else limit * supply
        state[MOTOR, i] += step / (CURRENT_LAG + step) * (min(bound, max(-bound, u)) - state[MOTOR, i])
        torque[i] = _through(p, state, i, motion, step) - _push_back(p, i, motion[0, i], motion[1, i])
    for i in range(motion.shape[1]):
        for row in range(2):
            ring[count % REMEMBERED, row, i] = motion[row, i]


@compile_kernel
def measure_late(
    p: np.ndarray, ring: np.ndarray, count: int, motion: np.ndarray, i: int, step: float
) -> tuple[float, float]:
    """Return position [rad] and speed [rad/s] as an encoder tells them, some time late."""
    late = p[AGE, i] / step
    if late <= 0.0:
        return motion[0, i], motion[1, i]
    whole = int(np.floor(late))
    part, old = late - whole, ring[(count - whole - 1) % REMEMBERED]
    new = motion if whole == 0 else ring[(count - whole) % REMEMBERED]
    return (1.0 - part) * new[0, i] + part * old[0, i], (1.0 - part) * new[1, i] + part * old[1, i]


@compile_kernel
def _through(p: np.ndarray, state: np.ndarray, i: int, motion: np.ndarray, step: float) -> float:
    """Return the mean torque in the gear over one physics step [N·m]."""
    h, half, inertia = step / SUBSTEPS, 0.5 * p[PLAY, i], p[ROTOR, i]
    stiffness = 1.0 / (1.0 / GEAR_STIFFNESS + p[SOFTNESS, i])
    damping = GEAR_DAMPING * np.sqrt(stiffness * inertia)
    passed = 0.0
    for k in range(SUBSTEPS):
        twist = state[ANGLE, i] - (motion[0, i] + k * h * motion[1, i])
        beyond = np.sign(twist) * max(0.0, abs(twist) - half)
        gear = stiffness * beyond + damping * (state[OMEGA, i] - motion[1, i])
        if half > 0.0 and gear * beyond <= 0.0:
            gear = 0.0
        state[GEAR, i] = gear
        dry = _dry(p, state, i, h)
        state[OMEGA, i] += h / inertia * (state[MOTOR, i] - p[VISCOUS, i] * state[OMEGA, i] - dry - gear)
        state[ANGLE, i] += h * state[OMEGA, i]
        passed += gear / SUBSTEPS
    return passed


@compile_kernel
def _dry(p: np.ndarray, state: np.ndarray, i: int, h: float) -> float:
    """Return the dry friction on a rotor [N·m]; what presses the gear is motor and load together."""
    v = state[OMEGA, i]
    size = p[COULOMB, i] + p[LOAD, i] * abs(state[MOTOR, i] + state[GEAR, i])
    size += p[STRIBECK, i] * np.exp(-((v / p[STRIBECK_SPEED, i]) ** 2))
    if size <= 0.0:
        return 0.0
    before = state[BENT, i]
    state[BENT, i] = (before + h * v / BREAKAWAY) / (1.0 + h * abs(v) / BREAKAWAY)
    rate = BREAKAWAY * (state[BENT, i] - before) / h
    return size * state[BENT, i] + MICRO * np.sqrt(size / BREAKAWAY * p[ROTOR, i]) * rate


@compile_kernel
def _push_back(p: np.ndarray, i: int, q: float, v: float) -> float:
    if q > p[UPPER, i]:
        return max(0.0, STOP * (q - p[UPPER, i]) + STOP_DAMPING * v)
    if q < p[LOWER, i]:
        return min(0.0, STOP * (q - p[LOWER, i]) + STOP_DAMPING * v)
    return 0.0
