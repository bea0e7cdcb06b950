"""The calibration: small shifts that every joint has, refitted for every hypothesis so that none can hide in them.

Each has a prior spread; what is fitted costs (shift / spread)². The cost counts in every score: a cause that is itself
a gain or a friction cannot be had for nothing here, and it cannot buy its name by what a calibration would do as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gsl.core.plant import Plant
from gsl.core.servo import Servo

NAMES = ("kp", "kd", "coulomb", "zero", "offset", "inertia", "viscous")
# Logarithms of factors, [N·m], [rad] in the log, [rad] in the servo, `inertia_unit`s, [N·m·s/rad]: of one make of servo
# (estimate); friction in units of `Robot.torque_unit`. Viscous friction is what a gain's damping is until torque is
# limited.
SPREADS = np.array([0.04, 0.07, 0.012, 0.003, 0.003, 1.0, 0.015])
PROBES = np.array([0.05, 0.10, 0.02, 0.002, 0.002, 0.5, 0.02])  # of the finite differences
KP, KD, COULOMB, ZERO, OFFSET, INERTIA, VISCOUS = range(7)
HALF_STEP = 2.5e-4  # of a simulator at 0.5 ms [s]: replays and logs of one step have none between them
GAINS = (0.1, 10.0)  # factors, at most
INERTIAS = (-5.0, 20.0)  # units of the inertia, at most
LEAST = 0.2  # share of the nominal inertia that is left
ROTOR_SPREAD = 0.05  # of the rotors' inertia


def inertia_unit(servo: Servo) -> np.ndarray:
    """Return the unit of the shift of the inertia [kg·m²], shape (n_motors,).

    Damping that acts on the speed of half a physics step ago takes kd · step / 2 off the inertia: simulators of one
    robot differ by as much if their steps do.
    """
    return HALF_STEP * servo.kd + ROTOR_SPREAD * servo.armature


def no_shifts(joints: int) -> np.ndarray:
    """Return shifts that do nothing, shape (7, n_joints)."""
    return np.zeros((len(NAMES), joints))


def draw_shifts(rng: np.random.Generator, joints: int, spread: float = 1.0) -> np.ndarray:
    """Return shifts as one make of servo has them, or a share of that, shape (7, n_joints).

    A robot's inertia is never below the simulator's: its time has no step that damping could lag behind.
    """
    result = spread * SPREADS[:, None] * rng.standard_normal((len(NAMES), joints))
    result[INERTIA] = np.abs(result[INERTIA])
    return result


def prior_costs(shifts: np.ndarray, spread: float = 1.0) -> np.ndarray:
    """Return what each joint's shifts, shape (7, n_joints), cost where they spread by a share of SPREADS."""
    return np.asarray(((shifts / (spread * SPREADS[:, None])) ** 2).sum(axis=0))


def prior_cost(shifts: np.ndarray, spread: float = 1.0) -> float:
    """Return what all shifts, shape (7, n_joints), cost together."""
    return float(prior_costs(shifts, spread).sum())


def clip_shifts(shifts: np.ndarray) -> np.ndarray:
    """Return the nearest shifts that are possible, shape (7, n_joints)."""
    result = shifts.copy()
    result[INERTIA] = np.clip(result[INERTIA], *INERTIAS)
    result[: KD + 1] = np.clip(result[: KD + 1], *np.log(GAINS))
    return result


def calibrate(plant: Plant, shifts: np.ndarray) -> Plant:
    """Return the plant with other gains, friction and log zeros; coupled motors have those of the joint they follow.

    Args:
        plant: Its first motors are the logged joints.
        shifts: Shape (7, n_joints).
    """
    wide = shifts[:, plant.robot.drive]
    servo, unit = plant.servo, plant.robot.torque_unit
    changed = plant.with_servo(
        kp=servo.kp * np.exp(wide[KP]),
        kd=servo.kd * np.exp(wide[KD]),
        coulomb=np.maximum(0.0, servo.coulomb + unit * wide[COULOMB]),
        offset=servo.offset + wide[OFFSET],
        viscous=np.maximum(0.0, servo.viscous + unit * wide[VISCOUS]),
        armature=np.maximum(LEAST * servo.armature, servo.armature + wide[INERTIA] * inertia_unit(servo)),
    )
    return replace(changed, sensors=replace(plant.sensors, bias=plant.sensors.bias + wide[ZERO]))


def to_effects(joints: Sequence[str], shifts: np.ndarray, plant: Plant) -> Mapping[str, Any]:
    """Return shifts, shape (7, n_joints), as effects of single joints of a plant, other effects in it already."""
    unit, torque = inertia_unit(plant.servo), plant.robot.torque_unit
    lightest = (LEAST - 1.0) * plant.servo.armature
    rows = [(joint, shifts[:, k], unit[k], lightest[k]) for k, joint in enumerate(joints)]
    return {
        "servo_gain": [{"kp": np.exp(row[KP]), "kd": np.exp(row[KD]), "joints": joint} for joint, row, _, _ in rows],
        "coulomb_friction": [{"torque": torque * row[COULOMB], "joints": joint} for joint, row, _, _ in rows],
        "viscous_friction": [{"coefficient": torque * row[VISCOUS], "joints": joint} for joint, row, _, _ in rows],
        "armature": [{"inertia": max(row[INERTIA] * size, end), "joints": joint} for joint, row, size, end in rows],
        "sensor_bias": [{"bias": row[ZERO], "joints": joint} for joint, row, _, _ in rows],
        "zero_offset": [{"offset": row[OFFSET], "joints": joint} for joint, row, _, _ in rows],
    }
