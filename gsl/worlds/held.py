"""Replays of a robot held in the air: recorded commands from measured states, through servos and chain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gsl.core.compiled import compiled
from gsl.core.plant import Plant
from gsl.worlds.chain import COLUMNS, Chain, accelerate, chain, motor_of
from gsl.worlds.encoder import first_history
from gsl.worlds.servo import COMMANDS, ROTOR, SMOOTHED, SPEED, ServoState, encoder_motion, packed, servo_torque

RUNAWAY = 1e3  # speed at which a replay has no meaning any more [rad/s]


class Windows(NamedTuple):
    """Pieces of logs to replay, W of them, T control periods each.

    Attributes:
        commands: Motor targets, newest first, the last of the window to the oldest before it [rad],
            shape (W, T + COMMANDS - 1, n_motors).
        motion: Positions [rad] and velocities [rad/s] at the beginning, shape (W, 2, n_motors).
        clock: Time since the episode began, at the beginning [s], shape (W,).
    """

    commands: np.ndarray
    motion: np.ndarray
    clock: np.ndarray

    @property
    def length(self) -> int:
        """Control periods of a window, T."""
        return self.commands.shape[1] - COMMANDS + 1


@dataclass(frozen=True)
class Held:
    """A plant in the air, ready for replays.

    Attributes:
        servo: Parameters of the servos.
        tree: The chain of its links.
        pushes: Rows of motor, start, end [s], force [N]; shape (k, 6).
        bias: Of the logged positions [rad], shape (n_motors,).
        step: Physics period [s].
        period: Control period [s].
    """

    servo: np.ndarray
    tree: Chain
    pushes: np.ndarray
    bias: np.ndarray
    step: float
    period: float

    @classmethod
    def of(cls, plant: Plant, step: float, period: float) -> Held:
        """Prepare a plant."""
        servo = packed(plant.servo, plant.robot.supply_voltage)
        pushes = [(motor_of(plant.robot, p.link), p.start, p.end, *p.force) for p in plant.pushes]
        tree = chain(plant, plant.servo.armature - servo[ROTOR])
        return cls(servo, tree, np.array(pushes).reshape(-1, 6), plant.sensors.bias, step, period)

    def replay(self, windows: Windows) -> np.ndarray:
        """Return what the encoders tell after each control period [rad], shape (W, T, n_motors); NaN if it diverges."""
        told = np.full((len(windows.clock), windows.length, len(self.bias)), np.nan)
        _replay(self.servo, self.tree, self.pushes, windows, self.step, round(self.period / self.step), told)
        return told + self.bias


@compiled
def _replay(
    servo: np.ndarray, tree: Chain, pushes: np.ndarray, windows: Windows, step: float, substeps: int, told: np.ndarray
) -> None:
    periods, n = told.shape[1], told.shape[2]
    torque, work, matrix, pushed = np.zeros(n), np.zeros((n, COLUMNS)), np.zeros((n, n)), np.zeros((n, 3))
    encoders = np.zeros((2, n))
    for w in range(told.shape[0]):
        motion, commands = windows.motion[w].copy(), windows.commands[w]
        memory, clock = np.zeros((8, n)), np.array([windows.clock[w], 0.0])
        memory[1], memory[2], memory[SPEED], memory[SMOOTHED] = motion[0], motion[1], motion[1], commands[periods]
        history = first_history(motion, step)
        for t in range(periods):
            state = ServoState(commands[periods - 1 - t : periods - 1 - t + COMMANDS], memory, history, clock)
            for k in range(substeps):
                servo_torque(servo, state, motion, k * step, step, substeps * step, torque)
                _pushes(pushes, clock[0] + k * step, pushed)
                accelerate(tree, motion, pushed, torque, work, matrix)
                for i in range(n):
                    motion[1, i] += step * torque[i]
                    motion[0, i] += step * motion[1, i]
            if not np.all(np.abs(motion[1]) < RUNAWAY):
                break
            encoder_motion(servo, state, motion, step, encoders)
            told[w, t] = encoders[0]
            clock[0] += substeps * step


@compiled
def _pushes(pushes: np.ndarray, time: float, pushed: np.ndarray) -> None:
    for row in pushes:
        motor = int(row[0])
        if motor >= 0:
            for k in range(3):
                pushed[motor, k] = row[3 + k] if row[1] <= time < row[2] else 0.0
