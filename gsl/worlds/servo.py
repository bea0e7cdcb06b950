"""The joint servo, compiled: from targets and joint motion to the torque of every joint at one physics step.

The same for one robot and for robots side by side (`lanes`): then what changes in time is lanes where it says float.

    target <- command(t - delay), smoothed, rounded
    e = dead(target + offset - q)                     q as the encoder tells it
    u = clip(kp (1 - fade t) e + kd (speed(t - delay) - dq/dt) + torque(t - delay))
                                                      driving torque falls to zero at the no-load speed, braking not
    rotor inertia                                     see rotor.py; beyond play or a spring the rotor is a second mass
    torque = u (1 - duty_loss |u| / limit) - viscous dq/dt - dry friction - hard stops

A desired speed and a feed-forward torque are zero unless the commands have columns of them. They come with the target
and are as late; smoothing and rounding are of the target alone. With kp = 0 a servo follows a speed or bears a torque.
Shares of kp and kd come in two more columns where gains are sent row by row.

A learned law, if there is one, adds to u and to the torque (gsl/core/servo_law.py).

Dry friction is a bristle that gives way at the friction's size (Dahl 1968): torque = k z, z follows the motion and is
held within +-BRISTLE; it holds a joint at rest under load without creep, which a clipped stopping torque does not. Its
size is coulomb + stribeck exp(-(v / stribeck_velocity)²) + load_friction |u - external torque| (Rhoban/bam, M4), the
external torque being what the last physics step tells: armature · acceleration - u + friction.
"""

from __future__ import annotations

import numpy as np

from gsl.core.compiled import compile_inner
from gsl.core.lanes import where
from gsl.core.servo import ROW
from gsl.core.servo_law import LAG, LAGS, NOBODY, SIGN, SPEED_UNIT, act, network
from gsl.worlds.drive_train import limit_torque, stop_torque, through_gear
from gsl.worlds.encoder import REMEMBERED, read_encoder
from gsl.worlds.servo_state import (
    BENT,
    COMMANDS,
    DRIVE,
    FRICTION,
    GROUP,
    HARDNESS,
    LAG_SHARE,
    LAW_BENT,
    OUTPUT_ARMATURE,
    PER_AMPERE,
    ROTOR,
    ROTOR_ANGLE,
    ROTOR_SPEED,
    SAG,
    SIZE,
    SMOOTHED,
    SPEED,
    STIFFNESS,
    THROUGH,
    TORQUE,
    ServoParameters,
    ServoState,
)

# Deflection at which dry friction slips [rad], or `Joint.size`s: below an encoder's noise, stable at 2 ms with ours.
BRISTLE = 1e-3
BESIDE = 3  # columns a motor before the shares of its gains: target, desired speed, feed-forward torque


@compile_inner
def servo_torque(
    servos: ServoParameters,
    state: ServoState,
    motion: np.ndarray,
    elapsed: float,
    step: float,
    period: float,
    torque: np.ndarray,
) -> None:
    """Fill `torque` [N·m] for one physics step and move `state` on.

    Args:
        servos: From `pack`.
        state: Changed in place, but for `commands` and the time, which are the caller's.
        motion: Positions [rad] then velocities [rad/s] at the output, shape (2, n_motors).
        elapsed: Time since the newest command was issued [s].
        step: Physics period [s].
        period: Control period [s].
        torque: Result, shape (n_motors,).
    """
    parameters = servos.rows
    current = compute_current(parameters, state.memory)
    for i in range(motion.shape[1]):
        error, q, v = sense_error(parameters, state, i, motion, elapsed, step, period)
        u, output = compute_wanted_torque(servos, state, i, motion, error, q, v, elapsed, step, period)
        supply = supply_share(parameters, i, current)
        torque[i] = output_torque(parameters, state.memory, i, motion, u, output, supply, step)
    state.steps[0] += 1


@compile_inner
def compute_current(parameters: np.ndarray, memory: np.ndarray) -> float:
    """Return the current of all motors at the last physics step [A]."""
    current = 0.0
    for i in range(memory.shape[1]):
        current += abs(memory[DRIVE, i]) * parameters[PER_AMPERE, i]
    return current


@compile_inner
def supply_share(parameters: np.ndarray, i: int, current: float) -> float:
    """Return the share of the supply's voltage that is left at a current of all motors [A]."""
    return max(1e-3, 1.0 - parameters[SAG, i] * current)


@compile_inner
def sense_error(
    parameters: np.ndarray, state: ServoState, i: int, motion: np.ndarray, elapsed: float, step: float, period: float
) -> tuple[float, float, float]:
    """Return motor i's control error [rad], and position [rad] and velocity [rad/s] as its servo sees them."""
    count = state.steps[0]
    target = delay_command(state.commands, i, (elapsed - parameters[ROW.delay, i]) / period, step / period)
    target = shape_target(parameters, state.memory, i, target, step)
    q, v = _measure(parameters, state.memory, i, motion)
    if parameters[ROW.sensor_delay, i] > 0.0:
        delay, now, whole = parameters[ROW.sensor_delay, i], (q, v), step * state.steps[1]
        q, v = (
            read_encoder(delay, state.history, count, q, 0, i, whole),
            read_encoder(delay, state.history, count, v, 1, i, whole),
        )
        for row in range(2):
            state.history[count % REMEMBERED, row, i] = now[row]
    return target + parameters[ROW.offset, i] - q, q, v


@compile_inner
def compute_gain(parameters: np.ndarray, state: ServoState, i: int, elapsed: float) -> float:
    """Return motor i's proportional gain after what time has taken of it [N·m/rad]."""
    fade = max(0.0, 1.0 - parameters[ROW.fade, i] * max(0.0, state.clock[0] + elapsed))
    return fade * parameters[ROW.kp, i]


@compile_inner
def compute_wanted_torque(
    servos: ServoParameters, state: ServoState, i: int, motion: np.ndarray, error: float, q: float, v: float,
    elapsed: float, step: float, period: float,
) -> tuple[float, float]:  # fmt: skip
    """Return the torque that motor i's servo wants and what a learned law adds at the output [N·m]."""
    parameters = servos.rows
    error -= min(parameters[ROW.deadband, i], max(-parameters[ROW.deadband, i], error))
    gain, motors = compute_gain(parameters, state, i, elapsed), motion.shape[1]
    u, output = gain * error - parameters[ROW.kd, i] * v, 0.0 * v
    if state.commands.shape[1] > motors:
        speed, feed = command_beside(parameters, state.commands, i, motors, elapsed, step, period)
        u += parameters[ROW.kd, i] * speed + feed
        if state.commands.shape[1] > BESIDE * motors:
            of_kp, of_kd = gain_shares(parameters, state.commands, i, motors, elapsed, step, period)
            u += (of_kp - 1.0) * gain * error + (of_kd - 1.0) * parameters[ROW.kd, i] * (speed - v)
    if parameters[GROUP, i] != NOBODY:
        since = elapsed - parameters[ROW.delay, i]
        for k in range(LAGS):
            lagged = delay_command(state.commands, i, (since - LAG * k) / period, step / period)
            state.layers[0, k] = parameters[STIFFNESS, i] * (lagged + parameters[ROW.offset, i] - q)
        drive, output = _evaluate_law(parameters, servos.weights, state.memory, i, motion[1, i], step, state.layers)
        u += drive
    return u, output


@compile_inner
def _evaluate_law(
    parameters: np.ndarray, weights: np.ndarray, memory: np.ndarray, i: int, v: float, step: float, layers: np.ndarray
) -> tuple[float, float]:
    """Return what motor i's law adds before the torque limit and behind it [N·m], errors being in `layers` already."""
    v = v / parameters[SIZE, i]
    memory[LAW_BENT, i] = min(BRISTLE, max(-BRISTLE, memory[LAW_BENT, i] + v * step))
    layers[0, LAGS] = v / SPEED_UNIT
    layers[0, LAGS + 1] = act(SIGN * v)
    layers[0, LAGS + 2] = memory[LAW_BENT, i] / BRISTLE
    drive, output = network(weights, int(parameters[GROUP, i]), layers)
    for k in range(LAGS):
        drive += parameters[LAG_SHARE + k, i] * layers[0, k]
    return parameters[TORQUE, i] * drive, parameters[TORQUE, i] * output


@compile_inner
def encoder_motion(
    servos: ServoParameters, state: ServoState, motion: np.ndarray, step: float, measured: np.ndarray
) -> None:
    """Fill `measured` with what the encoders tell between two physics steps, given the outputs', both (2, n_motors)."""
    parameters = servos.rows
    for i in range(motion.shape[1]):
        measured[0, i], measured[1, i] = _measure(parameters, state.memory, i, motion)
        if parameters[ROW.sensor_delay, i] > 0.0:
            for row in range(2):
                now, delay = measured[row, i], parameters[ROW.sensor_delay, i]
                measured[row, i] = read_encoder(delay, state.history, state.steps[0], now, row, i, step)


@compile_inner
def _measure(parameters: np.ndarray, memory: np.ndarray, i: int, motion: np.ndarray) -> tuple[float, float]:
    """Return position [rad] and velocity [rad/s] at the encoder now."""
    if parameters[ROW.motor_encoder, i] * parameters[ROTOR, i] > 0.0:
        return memory[ROTOR_ANGLE, i], memory[ROTOR_SPEED, i]
    return motion[0, i], motion[1, i]


@compile_inner
def delay_command(commands: np.ndarray, i: int, start: float, length: float) -> float:
    """Mean of a delayed, held command over one physics step: continuous in the delay.

    Args:
        commands: Newest first, see `ServoState`.
        i: Column.
        start: Beginning of the step after the delayed arrival of the newest command [control periods], often negative.
        length: Of the step [control periods].
    """
    index = min(max(int(np.ceil(-start - 1e-9)), 0), COMMANDS - 1)
    if index == 0:
        return commands[0, i]
    newer = min(1.0, max(0.0, (start + length + index - 1) / length))
    return (1.0 - newer) * commands[index, i] + newer * commands[index - 1, i]


@compile_inner
def command_beside(
    parameters: np.ndarray, commands: np.ndarray, i: int, motors: int, elapsed: float, step: float, period: float
) -> tuple[float, float]:
    """Return the desired speed [rad/s] and the feed-forward torque [N·m] of motor i, as late as its target is."""
    start, length = (elapsed - parameters[ROW.delay, i]) / period, step / period
    speed = delay_command(commands, motors + i, start, length)
    return speed, delay_command(commands, 2 * motors + i, start, length)


@compile_inner
def gain_shares(
    parameters: np.ndarray, commands: np.ndarray, i: int, motors: int, elapsed: float, step: float, period: float
) -> tuple[float, float]:
    """Return which shares of its kp and kd motor i is sent, as late as its target is; 1 where none are sent."""
    if commands.shape[1] <= BESIDE * motors:  # lanes where commands are
        return 1.0 + 0.0 * commands[0, i], 1.0 + 0.0 * commands[0, i]
    start, length, k = (elapsed - parameters[ROW.delay, i]) / period, step / period, BESIDE * motors + i
    return delay_command(commands, k, start, length), delay_command(commands, k + motors, start, length)


@compile_inner
def shape_target(parameters: np.ndarray, memory: np.ndarray, i: int, target: float, step: float) -> float:
    """Filter and round a target [rad]."""
    if parameters[ROW.smoothing, i] > 0.0:
        memory[SMOOTHED, i] += (1.0 - np.exp(-step / parameters[ROW.smoothing, i])) * (target - memory[SMOOTHED, i])
        target = memory[SMOOTHED, i]
    quantum = parameters[ROW.quantum, i]
    return quantum * np.rint(target / quantum) if quantum > 0.0 else target


@compile_inner
def output_torque(
    parameters: np.ndarray, memory: np.ndarray, i: int, motion: np.ndarray, u: float, output: float, supply: float,
    step: float,
) -> float:  # fmt: skip
    """Return the torque at the output [N·m], given what the servo wants and the supply's share of its voltage.

    Args:
        parameters: Rows of `ServoParameters`.
        memory: Of `ServoState`, column i moved on by one step.
        i: Motor.
        motion: Positions [rad] and velocities [rad/s] at the output, shape (2, n_motors).
        u: Wanted torque [N·m].
        output: Torque that a learned law adds at the output, as less friction [N·m].
        supply: Share of the supply's voltage that is left.
        step: Physics period [s].
    """
    q, v = motion[0, i], motion[1, i]
    bound, no_load = supply * parameters[ROW.limit, i], supply * parameters[ROW.no_load_speed, i]
    if parameters[ROW.duty_loss, i] > 0.0:
        limit = parameters[ROW.limit, i]
        u = min(limit, max(-limit, u))
        u *= 1.0 - parameters[ROW.duty_loss, i] * abs(u) / limit
    drive = limit_torque(u, v, bound, no_load)
    through = drive
    if parameters[ROTOR, i] > 0.0:
        through = through_gear(
            memory[ROTOR_ANGLE : ROTOR_SPEED + 1], i, motion, u, bound, no_load, parameters[ROTOR, i],
            parameters[ROW.play, i], parameters[ROW.compliance, i], parameters[HARDNESS, i], step,
        )  # fmt: skip
    friction = parameters[ROW.viscous, i] * v + _dry(parameters, memory, i, v, through, step) - output
    memory[DRIVE, i], memory[THROUGH, i], memory[FRICTION, i], memory[SPEED, i] = drive, through, friction, v
    above, below = q - parameters[ROW.upper_stop, i], parameters[ROW.lower_stop, i] - q
    return through - friction + parameters[HARDNESS, i] * (stop_torque(above, v) - stop_torque(below, -v))


@compile_inner
def _dry(parameters: np.ndarray, memory: np.ndarray, i: int, v: float, through: float, step: float) -> float:
    size, stribeck, load = parameters[ROW.coulomb, i], parameters[ROW.stribeck, i], parameters[ROW.load_friction, i]
    if size == 0.0 and stribeck == 0.0 and load == 0.0:
        return 0.0
    if stribeck > 0.0:
        ratio = v / parameters[ROW.stribeck_velocity, i]
        size += stribeck * np.exp(-(ratio * ratio))
    if load > 0.0:
        inertial = parameters[OUTPUT_ARMATURE, i] * (v - memory[SPEED, i]) / step
        external = inertial - memory[THROUGH, i] + memory[FRICTION, i]
        size += load * abs(through - external)
    slips, free = BRISTLE * parameters[SIZE, i], size == 0.0
    bent = min(slips, max(-slips, memory[BENT, i] + v * step))
    memory[BENT, i] = where(free, memory[BENT, i], bent)
    return where(free, 0.0, size * bent / slips)
