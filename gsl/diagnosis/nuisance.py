"""Nuisances: small deviations that every joint has, refitted for every candidate so that none can hide in them.

Each has a prior size; what is fitted costs (shift / size)². The cost counts in every score: a cause that is itself a
gain or a friction cannot be had for nothing here, and it cannot buy its name by what a calibration would do as well.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gsl.core.plant import Plant
from gsl.core.servo import Servo

NAMES = ("kp", "kd", "coulomb", "zero", "offset", "inertia", "viscous")
# Logarithms of factors, [N·m], [rad] in the log, [rad] in the servo, `inertia_unit`s, [N·m·s/rad]: of one make of servo
# (estimate); friction in units of `Robot.torque_unit`. Viscous friction is what a gain's damping is until torque is
# limited.
SIZES = np.array([0.04, 0.07, 0.012, 0.003, 0.003, 1.0, 0.015])
PROBES = np.array([0.05, 0.10, 0.02, 0.002, 0.002, 0.5, 0.02])  # of the finite differences
KP, KD, COULOMB, ZERO, OFFSET, INERTIA, VISCOUS = range(7)
HALF_STEP = 1e-3  # of a simulator at 2 ms [s]
FACTORS = (0.1, 10.0)  # of the gains, at most
INERTIAS = (-5.0, 20.0)  # units of the inertia, at most
LEAST = 0.2  # share of the nominal inertia that is left
SPREAD = 0.05  # of the rotors' inertia


def inertia_unit(servo: Servo) -> np.ndarray:
    """Return what is the unit of the inertia's nuisance [kg·m²], shape (n_motors,).

    Damping that acts on the speed of half a physics step ago takes kd · step / 2 off the inertia: simulators of one
    robot differ by as much if their steps do.
    """
    return HALF_STEP * servo.kd + SPREAD * servo.armature


def none(joints: int) -> np.ndarray:
    """Return nuisances that do nothing, shape (7, n_joints)."""
    return np.zeros((len(NAMES), joints))


def drawn(rng: np.random.Generator, joints: int, spread: float = 1.0) -> np.ndarray:
    """Return nuisances as one make of servo has them, or a share of that, shape (7, n_joints).

    A robot's inertia is never below the simulator's: its time has no step that damping could lag behind.
    """
    result = spread * SIZES[:, None] * rng.standard_normal((len(NAMES), joints))
    result[INERTIA] = np.abs(result[INERTIA])
    return result


def cost(nuisances: np.ndarray, spread: float = 1.0) -> float:
    """Return what nuisances, shape (7, n_joints), cost where they spread by a share of SIZES."""
    return float(((nuisances / (spread * SIZES[:, None])) ** 2).sum())


def bounded(nuisances: np.ndarray) -> np.ndarray:
    """Return the nearest nuisances that are possible, shape (7, n_joints)."""
    result = nuisances.copy()
    result[INERTIA] = np.clip(result[INERTIA], *INERTIAS)
    result[: KD + 1] = np.clip(result[: KD + 1], *np.log(FACTORS))
    return result


def calibrated(plant: Plant, nuisances: np.ndarray) -> Plant:
    """Return the plant with other gains, friction and log zeros; coupled motors have those of the joint they follow.

    Args:
        plant: Its first motors are the logged joints.
        nuisances: Shape (7, n_joints).
    """
    wide = nuisances[:, plant.robot.drive]
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
