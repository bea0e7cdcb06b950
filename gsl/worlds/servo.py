"""The joint servo, compiled: from targets and joint motion to the torque of every joint at one physics step.

    e = target(t - delay) - q             q at the output encoder
    u = clip(kp e - kd dq/dt)             driving torque falls to zero at the no-load speed, braking torque does not
    rotor inertia                         see rotor.py; beyond backlash the rotor is a second mass of its own
    torque = u - viscous dq/dt - dry friction

Dry friction is a bristle that gives way at the Coulomb torque (Dahl 1968): torque = k z, z follows the motion and is
held within +-BRISTLE; it holds a joint at rest under load without creep, which a clipped stopping torque does not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsl.core.compiled import compiled
from gsl.core.plant import Servo

BRISTLE = 1e-3  # deflection at which dry friction slips [rad]: below an encoder's noise, stable at 2 ms with our rotors
TOOTH_STIFFNESS = 300.0  # of the gear teeth in contact, if there is play [N·m/rad]: an estimate
ROTOR_SHARE = 0.7  # of the armature that is beyond the play; the rest moves with the output and keeps 2 ms stable
TOOTH_SUBSTEPS = 8
COMMANDS = 16  # control periods of targets that are remembered: the longest delay

KP, KD, LIMIT, NO_LOAD, COULOMB, VISCOUS, DELAY, PLAY, ROTOR = range(9)  # rows of the parameters
BENT, ROTOR_ANGLE, ROTOR_SPEED = range(3)  # rows of the state


class ServoState(NamedTuple):
    """What changes in time; `servo_torque` writes into `memory`.

    Attributes:
        commands: Targets of the last control periods, newest first [rad], shape (COMMANDS, n_motors).
        memory: Bristle deflection [rad], rotor angle [rad] and speed [rad/s] as seen at the output, (3, n_motors).
    """

    commands: np.ndarray
    memory: np.ndarray


def packed(servo: Servo) -> np.ndarray:
    """Return the parameters as the kernel reads them, shape (9, n_motors)."""
    rotor = np.where(servo.play > 0.0, ROTOR_SHARE * servo.armature, 0.0)
    rows = (
        servo.kp,
        servo.kd,
        servo.limit,
        servo.no_load_speed,
        servo.coulomb,
        servo.viscous,
        servo.delay,
        servo.play,
        rotor,
    )
    return np.array(rows)


def first_state(commands: np.ndarray, motion: np.ndarray) -> ServoState:
    """Return the state of servos in motion, their bristles slack and their gaps centred.

    Args:
        commands: Targets so far, newest first [rad], shape (k, n_motors); the oldest one is taken to be older still.
        motion: Positions [rad] and velocities [rad/s] at the output, shape (2, n_motors).
    """
    older = np.repeat(commands[-1:], max(0, COMMANDS - len(commands)), axis=0)
    return ServoState(np.vstack([commands, older])[:COMMANDS].copy(), np.vstack([np.zeros(motion.shape[1]), motion]))


@compiled
def servo_torque(
    parameters: np.ndarray,
    commands: np.ndarray,
    memory: np.ndarray,
    motion: np.ndarray,
    elapsed: float,
    step: float,
    period: float,
    torque: np.ndarray,
) -> None:
    """Fill `torque` [N·m] for one physics step and move `memory` on.

    Args:
        parameters: From `packed`.
        commands: Targets, newest first [rad], shape (COMMANDS, n_motors).
        memory: State rows, changed in place.
        motion: Positions [rad] then velocities [rad/s], shape (2, n_motors).
        elapsed: Time since the newest command was issued [s].
        step: Physics period [s].
        period: Control period [s].
        torque: Result, shape (n_motors,).
    """
    for i in range(motion.shape[1]):
        q, v = motion[0, i], motion[1, i]
        target = _delayed(commands, i, (elapsed - parameters[DELAY, i]) / period, step / period)
        u = parameters[KP, i] * (target - q) - parameters[KD, i] * v
        bound = parameters[LIMIT, i]
        if parameters[PLAY, i] > 0.0:
            through = _through_teeth(parameters, memory, i, q, v, u, step)
        else:
            through = _limited(u, v, bound, parameters[NO_LOAD, i])
        friction = parameters[VISCOUS, i] * v
        if parameters[COULOMB, i] > 0.0:
            bent = min(BRISTLE, max(-BRISTLE, memory[BENT, i] + v * step))
            memory[BENT, i] = bent
            friction += parameters[COULOMB, i] * bent / BRISTLE
        torque[i] = through - friction


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
        return float(commands[0, i])
    newer = min(1.0, max(0.0, (start + length + index - 1) / length))
    return float((1.0 - newer) * commands[index, i] + newer * commands[index - 1, i])


@compiled
def _limited(u: float, v: float, bound: float, no_load: float) -> float:
    high = bound * min(1.0, max(0.0, 1.0 - v / no_load)) if v > 0.0 else bound
    low = bound * min(1.0, max(0.0, 1.0 + v / no_load)) if v < 0.0 else bound
    return min(high, max(-low, u))


@compiled
def _through_teeth(
    parameters: np.ndarray, memory: np.ndarray, i: int, q: float, v: float, u: float, step: float
) -> float:
    """Torque that the teeth pass on; the rotor is integrated in substeps with the teeth's push and damping."""
    inertia, half = parameters[ROTOR, i], 0.5 * parameters[PLAY, i]
    damping = 0.2 * np.sqrt(TOOTH_STIFFNESS * inertia)
    h, passed = step / TOOTH_SUBSTEPS, 0.0
    angle, speed = memory[ROTOR_ANGLE, i], memory[ROTOR_SPEED, i]
    for k in range(TOOTH_SUBSTEPS):
        gap = angle - (q + v * h * k)
        push = 0.0
        if gap > half:
            push = max(0.0, TOOTH_STIFFNESS * (gap - half) + damping * (speed - v))
        elif gap < -half:
            push = min(0.0, TOOTH_STIFFNESS * (gap + half) + damping * (speed - v))
        drive = _limited(u, speed, parameters[LIMIT, i], parameters[NO_LOAD, i])
        speed += h * (drive - push) / inertia
        angle += h * speed
        passed += push / TOOTH_SUBSTEPS
    memory[ROTOR_ANGLE, i], memory[ROTOR_SPEED, i] = angle, speed
    return passed
