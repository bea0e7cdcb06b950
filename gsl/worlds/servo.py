"""The joint servo, compiled: from targets and joint motion to the torque of every joint at one physics step.

The same for one robot and for robots side by side (`lanes`): then what changes in time is lanes where it says float.

    target <- command(t - delay), smoothed, rounded
    e = dead(target + offset - q)                     q as the encoder tells it
    u = clip(kp (1 - fade t) e - kd dq/dt)            driving torque falls to zero at the no-load speed, braking not
    rotor inertia                                     see rotor.py; beyond play or a spring the rotor is a second mass
    torque = u (1 - duty_loss |u| / limit) - viscous dq/dt - dry friction - hard stops

Dry friction is a bristle that gives way at the friction's size (Dahl 1968): torque = k z, z follows the motion and is
held within +-BRISTLE; it holds a joint at rest under load without creep, which a clipped stopping torque does not. Its
size is coulomb + stribeck exp(-(v / stribeck_velocity)²) + load_friction |u - external torque| (Rhoban/bam, M4), the
external torque being what the last physics step tells: armature · acceleration - u + friction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsl.core.compiled import compiled
from gsl.core.lanes import where
from gsl.core.plant import Servo
from gsl.worlds.drive_train import ROTOR_SHARE, STIFFEST, limited, through_gear
from gsl.worlds.encoder import REMEMBERED, first_history, seen

BRISTLE = 1e-3  # deflection at which dry friction slips [rad]: below an encoder's noise, stable at 2 ms with our rotors
STOP_STIFFNESS, STOP_DAMPING = 500.0, 2.0  # of a hard stop [N·m/rad], [N·m·s/rad]: stable at 2 ms with our rotors
COMMANDS = 16  # control periods of targets that are remembered: the longest delay

(
    KP, KD, LIMIT, NO_LOAD, COULOMB, VISCOUS, STRIBECK, STRIBECK_VELOCITY, LOAD, OUTPUT_ARMATURE, DELAY, SMOOTHING,
    QUANTUM, DEADBAND, PLAY, COMPLIANCE, SAG, DUTY_LOSS, FADE, OFFSET, SENSOR_DELAY, LOWER, UPPER, MOTOR_ENCODER,
    PER_AMPERE, ROTOR,
) = range(26)  # rows of the parameters  # fmt: skip
BENT, ROTOR_ANGLE, ROTOR_SPEED, SMOOTHED, SPEED, DRIVE, THROUGH, FRICTION = range(8)  # rows of the state


class ServoState(NamedTuple):
    """What changes in time, all of it in place.

    Attributes:
        commands: Targets of the last control periods, newest first [rad], shape (COMMANDS, n_motors).
        memory: Bristle deflection [rad]; rotor angle [rad] and speed [rad/s] as seen at the output; filtered target
            [rad]; at the last physics step: output speed [rad/s], motor torque, torque through the gear, friction
            [N·m]; shape (8, n_motors).
        history: What the encoders measured at the last physics steps, see `encoder.seen`.
        clock: Time of the newest command since the episode began [s], shape (1,).
        steps: Number of physics steps so far, shape (1,).
    """

    commands: np.ndarray
    memory: np.ndarray
    history: np.ndarray
    clock: np.ndarray
    steps: np.ndarray


def packed(servo: Servo, supply_voltage: float) -> np.ndarray:
    """Return the parameters as the kernel reads them, shape (26, n_motors).

    Args:
        servo: The servos.
        supply_voltage: Of the common supply without load [V].
    """
    two_masses = (servo.play > 0.0) | (servo.compliance >= STIFFEST)
    rotor = np.where(two_masses, ROTOR_SHARE * servo.armature, 0.0)
    rows = (
        servo.kp, servo.kd, servo.limit, servo.no_load_speed, servo.coulomb, servo.viscous, servo.stribeck,
        servo.stribeck_velocity, servo.load_friction, servo.armature - rotor, servo.delay, servo.smoothing,
        servo.quantum, servo.deadband, servo.play, servo.compliance, servo.supply_resistance / supply_voltage,
        servo.duty_loss, servo.fade, servo.offset, servo.sensor_delay, servo.lower_stop, servo.upper_stop,
        servo.motor_encoder, 1.0 / servo.torque_constant, rotor,
    )  # fmt: skip
    return np.array(rows)


def first_state(commands: np.ndarray, motion: np.ndarray, step: float, clock: float = 0.0) -> ServoState:
    """Return the state of servos in motion, their bristles slack, gaps centred and filters settled.

    Args:
        commands: Targets so far, newest first [rad], shape (k, n_motors); the oldest one is taken to be older still.
        motion: Positions [rad] and velocities [rad/s] at the output, shape (2, n_motors).
        step: Physics period [s].
        clock: Time since the episode began [s].
    """
    older = np.repeat(commands[-1:], max(0, COMMANDS - len(commands)), axis=0)
    memory = np.zeros((8, motion.shape[1]))
    memory[ROTOR_ANGLE], memory[ROTOR_SPEED], memory[SMOOTHED], memory[SPEED] = *motion, commands[0], motion[1]
    return ServoState(
        np.vstack([commands, older])[:COMMANDS].copy(),
        memory,
        first_history(motion, step),
        np.array([clock]),
        np.zeros(1, dtype=np.int64),
    )


@compiled
def servo_torque(
    parameters: np.ndarray,
    state: ServoState,
    motion: np.ndarray,
    elapsed: float,
    step: float,
    period: float,
    torque: np.ndarray,
) -> None:
    """Fill `torque` [N·m] for one physics step and move `state` on.

    Args:
        parameters: From `packed`.
        state: Changed in place, but for `commands` and the time, which are the caller's.
        motion: Positions [rad] then velocities [rad/s] at the output, shape (2, n_motors).
        elapsed: Time since the newest command was issued [s].
        step: Physics period [s].
        period: Control period [s].
        torque: Result, shape (n_motors,).
    """
    memory, count = state.memory, state.steps[0]
    current = 0.0
    for i in range(motion.shape[1]):
        current += abs(memory[DRIVE, i]) * parameters[PER_AMPERE, i]
    for i in range(motion.shape[1]):
        target = _delayed(state.commands, i, (elapsed - parameters[DELAY, i]) / period, step / period)
        target = _shaped(parameters, memory, i, target, step)
        q, v = _measured(parameters, memory, i, motion)
        if parameters[SENSOR_DELAY, i] > 0.0:
            delay, now = parameters[SENSOR_DELAY, i], (q, v)
            q, v = seen(delay, state.history, count, q, 0, i, step), seen(delay, state.history, count, v, 1, i, step)
            for row in range(2):
                state.history[count % REMEMBERED, row, i] = now[row]
        fade = max(0.0, 1.0 - parameters[FADE, i] * max(0.0, state.clock[0] + elapsed))
        error = target + parameters[OFFSET, i] - q
        error -= min(parameters[DEADBAND, i], max(-parameters[DEADBAND, i], error))
        u = fade * parameters[KP, i] * error - parameters[KD, i] * v
        torque[i] = _output(parameters, memory, i, motion, u, max(1e-3, 1.0 - parameters[SAG, i] * current), step)
    state.steps[0] += 1


@compiled
def encoder_motion(
    parameters: np.ndarray, state: ServoState, motion: np.ndarray, step: float, told: np.ndarray
) -> None:
    """Fill `told` with what the encoders tell between two physics steps, given the outputs', both (2, n_motors)."""
    for i in range(motion.shape[1]):
        told[0, i], told[1, i] = _measured(parameters, state.memory, i, motion)
        if parameters[SENSOR_DELAY, i] > 0.0:
            for row in range(2):
                now, delay = told[row, i], parameters[SENSOR_DELAY, i]
                told[row, i] = seen(delay, state.history, state.steps[0], now, row, i, step)


@compiled
def _measured(parameters: np.ndarray, memory: np.ndarray, i: int, motion: np.ndarray) -> tuple[float, float]:
    """Return position [rad] and velocity [rad/s] at the encoder now."""
    if parameters[MOTOR_ENCODER, i] * parameters[ROTOR, i] > 0.0:
        return memory[ROTOR_ANGLE, i], memory[ROTOR_SPEED, i]
    return motion[0, i], motion[1, i]


@compiled
def _delayed(commands: np.ndarray, i: int, start: float, length: float) -> float:
    """Mean of a delayed, held command over one physics step: continuous in the delay.

    Args:
        commands: Newest first [rad], shape (COMMANDS, n_motors).
        i: Motor.
        start: Beginning of the step after the delayed arrival of the newest command [control periods], often negative.
        length: Of the step [control periods].
    """
    index = min(max(int(np.ceil(-start - 1e-9)), 0), COMMANDS - 1)
    if index == 0:
        return commands[0, i]
    newer = min(1.0, max(0.0, (start + length + index - 1) / length))
    return (1.0 - newer) * commands[index, i] + newer * commands[index - 1, i]


@compiled
def _shaped(parameters: np.ndarray, memory: np.ndarray, i: int, target: float, step: float) -> float:
    """Filter and round a target [rad]."""
    if parameters[SMOOTHING, i] > 0.0:
        memory[SMOOTHED, i] += (1.0 - np.exp(-step / parameters[SMOOTHING, i])) * (target - memory[SMOOTHED, i])
        target = memory[SMOOTHED, i]
    quantum = parameters[QUANTUM, i]
    return quantum * np.rint(target / quantum) if quantum > 0.0 else target


@compiled
def _output(
    parameters: np.ndarray, memory: np.ndarray, i: int, motion: np.ndarray, u: float, supply: float, step: float
) -> float:
    """Return the torque at the output, given what the servo wants and the supply's share of its voltage."""
    q, v = motion[0, i], motion[1, i]
    bound, no_load = supply * parameters[LIMIT, i], supply * parameters[NO_LOAD, i]
    if parameters[DUTY_LOSS, i] > 0.0:
        limit = parameters[LIMIT, i]
        u = min(limit, max(-limit, u))
        u *= 1.0 - parameters[DUTY_LOSS, i] * abs(u) / limit
    drive = limited(u, v, bound, no_load)
    through = drive
    if parameters[ROTOR, i] > 0.0:
        through = through_gear(
            memory[ROTOR_ANGLE : ROTOR_SPEED + 1], i, motion, u, bound, no_load, parameters[ROTOR, i],
            parameters[PLAY, i], parameters[COMPLIANCE, i], step,
        )  # fmt: skip
    friction = parameters[VISCOUS, i] * v + _dry(parameters, memory, i, v, through, step)
    memory[DRIVE, i], memory[THROUGH, i], memory[FRICTION, i], memory[SPEED, i] = drive, through, friction, v
    return through - friction + _stop(q - parameters[UPPER, i], v) - _stop(parameters[LOWER, i] - q, -v)


@compiled
def _dry(parameters: np.ndarray, memory: np.ndarray, i: int, v: float, through: float, step: float) -> float:
    if parameters[COULOMB, i] == 0.0 and parameters[STRIBECK, i] == 0.0 and parameters[LOAD, i] == 0.0:
        return 0.0
    size = parameters[COULOMB, i]
    if parameters[STRIBECK, i] > 0.0:
        ratio = v / parameters[STRIBECK_VELOCITY, i]
        size += parameters[STRIBECK, i] * np.exp(-(ratio * ratio))
    if parameters[LOAD, i] > 0.0:
        inertial = parameters[OUTPUT_ARMATURE, i] * (v - memory[SPEED, i]) / step
        external = inertial - memory[THROUGH, i] + memory[FRICTION, i]
        size += parameters[LOAD, i] * abs(through - external)
    bent, free = min(BRISTLE, max(-BRISTLE, memory[BENT, i] + v * step)), size == 0.0
    memory[BENT, i] = where(free, memory[BENT, i], bent)
    return where(free, 0.0, size * bent / BRISTLE)


@compiled
def _stop(beyond: float, v: float) -> float:
    """Return the torque of a stop that only pushes back [N·m], `beyond` it [rad] at speed v away from it."""
    return where(beyond > 0.0, -max(0.0, STOP_STIFFNESS * beyond + STOP_DAMPING * v), 0.0)
