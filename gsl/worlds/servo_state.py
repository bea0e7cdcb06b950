"""What the compiled servos read and remember: parameters in rows, and a state that moves on in place."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsl.core.compiled import compile_inner
from gsl.core.servo import ROW, Servo
from gsl.core.servo_law import HIDDEN, LAYERS, ServoLaw, no_law, weights
from gsl.worlds.drive_train import ROTOR_SHARE, STIFFEST
from gsl.worlds.encoder import REMEMBERED, fill_history

COMMANDS = 128  # control periods of targets that are remembered, 0.127 s of a log at 1 kHz: the longest delay

(OUTPUT_ARMATURE, ROTOR, SAG, PER_AMPERE, HARDNESS, SIZE, GROUP, STIFFNESS, TORQUE, LAG_SHARE) = range(
    len(ROW), len(ROW) + 10
)
"""Rows of the parameters that follow from the servo's numbers, whose own rows are `ROW`, and from a learned law."""
MEMORY = 9  # rows of the state
BENT, ROTOR_ANGLE, ROTOR_SPEED, SMOOTHED, SPEED, DRIVE, THROUGH, FRICTION, LAW_BENT = range(MEMORY)


class ServoParameters(NamedTuple):
    """What never changes; in few arrays, for every one that a compiled function passes on takes time.

    Attributes:
        rows: The numbers of `Servo`, then what follows from them, then a learned law's: see `ServoLaw`; shape
            (LAG_SHARE + LAGS, n_motors).
        weights: Of its networks, from `servo_law.weights`.
    """

    rows: np.ndarray
    weights: np.ndarray


class ServoState(NamedTuple):
    """What changes in time, all of it in place.

    Attributes:
        commands: Targets of the last control periods, newest first [rad], shape (COMMANDS, n_motors), or, where logs
            have other commands beside them, desired speeds [rad/s] and feed-forward torques [N·m] in further columns,
            shape (COMMANDS, 3 n_motors), and shares of kp and kd where gains vary, shape (COMMANDS, 5 n_motors).
        memory: Bristle deflection [rad]; rotor angle [rad] and speed [rad/s] as seen at the output; filtered target
            [rad]; at the last physics step: output speed [rad/s], motor torque, torque through the gear, friction
            [N·m]; bristle of the learned law [rad]; shape (MEMORY, n_motors).
        history: What the encoders measured at the last physics steps, see `encoder.seen`.
        clock: Time of the newest command since the episode began [s], shape (1,).
        steps: Number of physics steps so far, and of pieces that the next one is taken in, shape (2,).
        layers: Scratch of the learned law, shape (LAYERS, HIDDEN).
    """

    commands: np.ndarray
    memory: np.ndarray
    history: np.ndarray
    clock: np.ndarray
    steps: np.ndarray
    layers: np.ndarray


def pack(
    servo: Servo,
    supply_voltage: float,
    law: ServoLaw | None = None,
    hardness: np.ndarray | float = 1.0,
    sizes: np.ndarray | float = 1.0,
) -> ServoParameters:
    """Return the parameters as the kernel reads them.

    Args:
        servo: The servos.
        supply_voltage: Of the common supply without load [V].
        law: What they do beyond their parameters.
        hardness: Of stops and teeth, see `plant.hardness`, shape (n_motors,).
        sizes: What counts as much as a radian of a hinge, see `Joint.size`, shape (n_motors,).
    """
    law = no_law(len(servo.kp)) if law is None else law
    two_masses = (servo.play > 0.0) | (servo.compliance >= STIFFEST / hardness)
    rotor = np.where(two_masses, ROTOR_SHARE * servo.armature, 0.0)
    derived = (
        servo.armature - rotor, rotor, servo.supply_resistance / supply_voltage, 1.0 / servo.torque_constant,
        hardness + np.zeros(len(servo.kp)), sizes + np.zeros(len(servo.kp)), law.group, law.stiffness, law.torque,
        *law.lag.T,
    )  # fmt: skip
    return ServoParameters(np.array([*servo, *derived]), weights(law))


def first_state(commands: np.ndarray, motion: np.ndarray, step: float, clock: float = 0.0) -> ServoState:
    """Return the state of servos in motion, their bristles slack, gaps centred and filters settled.

    Args:
        commands: Commands so far, newest first, shape (k, n_motors) or wider, see `ServoState`; the oldest
            one is taken to be older still.
        motion: Positions [rad] and velocities [rad/s] at the output, shape (2, n_motors).
        step: Physics period [s].
        clock: Time since the episode began [s].
    """
    older = np.repeat(commands[-1:], max(0, COMMANDS - len(commands)), axis=0)
    memory, history = np.zeros((MEMORY, motion.shape[1])), np.empty((REMEMBERED, *motion.shape))
    settle(memory, history, motion, commands[0], step)
    return ServoState(
        np.vstack([commands, older])[:COMMANDS].copy(),
        memory,
        history,
        np.array([clock]),
        np.array([0, 1]),
        np.zeros((LAYERS, HIDDEN)),
    )


@compile_inner
def settle(memory: np.ndarray, history: np.ndarray, motion: np.ndarray, target: np.ndarray, step: float) -> None:
    """Write what settled servos remember, the rest of the memory being zero; floats or lanes.

    Args:
        memory: Of `ServoState`.
        history: Of `ServoState`.
        motion: Positions [rad] and velocities [rad/s] at the output, shape (2, n_motors).
        target: Of the filter [rad], shape (n_motors,).
        step: Physics period [s].
    """
    for i in range(motion.shape[1]):
        memory[ROTOR_ANGLE, i], memory[ROTOR_SPEED, i], memory[SPEED, i] = motion[0, i], motion[1, i], motion[1, i]
        memory[SMOOTHED, i] = target[i]
    fill_history(history, motion, step)


def senses_apart(servos: ServoParameters) -> bool:
    """Return whether encoders can tell anything but how the outputs move: late, or of a motor behind a spring."""
    rows = servos.rows
    return bool((rows[ROW.sensor_delay] > 0.0).any() or (rows[ROW.motor_encoder] * rows[ROTOR] > 0.0).any())
