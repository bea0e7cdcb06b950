"""A pendulum on one servo, by default the Dynamixel XL330-M288 with .49 kg at .10 m of Rhoban's bench.

The firmware drives the motor with a duty in proportion to the error; with P its gain and e duty per radian and P:

    duty = clip(P e (goal - q), -1, 1)          torque = kt V / R duty - kt² / R dq/dt

Stall torque is kt V / R and speed without load V / kt, so in the terms of our servo (worlds/servo.py)

    kp = P e stall        kd = stall / no_load        limit = stall        speed line from stall to no_load

which is the same torque but for a full duty against the motion, where the firmware's also has the braking kd dq/dt.

Sources:
    E  ROBOTIS e-manual, XL330-M288: stall torque and speed without load at 3.7, 5 and 6 V; 4096 steps a turn. Both grow
       linearly with the voltage; the bench runs at 7.4 V, above the rating, where the line is drawn on (unverified).
    F  Rhoban/bam, bam/dynamixel/actuator.py (Apache-2.0): the firmware's law, as observed; the manual has P / 128.
    G  Rhoban/bam, bam/params/xl330/m1.json (Apache-2.0): rotor inertia at the output, for which there is no data sheet.
       It was fitted to logs of this bench, as nothing else here was.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gsl.core.body import Joint, Link, Robot, Shape, with_mass
from gsl.robots.defaults import torque_unit

STALL = ((5.0, 0.52), (6.0, 0.60))  # [V], [N·m] E
NO_LOAD = ((5.0, 10.786), (6.0, 12.881))  # [V], [rad/s] E
DUTY_PER_RADIAN = (4096.0 / (2.0 * math.pi)) / (256.0 * 885.0)  # and unit of P, F
ARMATURE = 1.81e-3  # [kg·m²] G
ENCODER_STEP = 2.0 * math.pi / 4096.0  # [rad] E
FACTORY_GAIN = 400.0  # E
ARM_MASS = 0.01  # [kg]: not recorded; .01 kg is 1 % of the load's torque

_DARK, _STEEL, _BRASS = (0.16, 0.17, 0.2), (0.7, 0.72, 0.76), (0.8, 0.6, 0.25)


@dataclass(frozen=True)
class Xl330:
    """The servo at a firmware gain P and a voltage [V]."""

    gain: float = FACTORY_GAIN
    voltage: float = 7.4

    @property
    def stall(self) -> float:
        """Torque at standstill and full duty [N·m]."""
        return _line(STALL, self.voltage)

    @property
    def no_load(self) -> float:
        """Speed without load at full duty [rad/s]."""
        return _line(NO_LOAD, self.voltage)

    @property
    def kp(self) -> float:
        """Of our servo [N·m/rad]."""
        return self.gain * DUTY_PER_RADIAN * self.stall

    @property
    def kd(self) -> float:
        """Of our servo: the motor's own braking by its voltage [N·m·s/rad]."""
        return self.stall / self.no_load


def bench(servo: Xl330, *, mass: float = 0.49, length: float = 0.10, arm_mass: float = ARM_MASS) -> Robot:
    """Return a pendulum that hangs down at zero: its weight's torque is -(mass + arm_mass / 2) g length sin q.

    The mass is a point, as in F.

    Args:
        servo: What drives it.
        mass: At the end [kg].
        length: Of the arm [m].
        arm_mass: Of the arm [kg].
    """
    across, end = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -length])
    rod = arm_mass * length**2 / 12.0 * np.diag([1.0, 1.0, 1e-3])
    radius = (mass / (7850.0 * 4.0 / 3.0 * math.pi)) ** (1.0 / 3.0)  # of a ball of steel, which only shows [m]
    pole = with_mass(Link("pendulum", arm_mass, 0.5 * end, rod), mass, end, np.zeros((3, 3)))
    shapes = (
        Shape("cylinder", (0.004, length), (0.0, 0.012, -0.5 * length), colour=_STEEL),
        Shape("sphere", (radius,), (0.0, 0.012, -length), colour=_BRASS),
        Shape("cylinder", (0.008, 0.008), (0.0, 0.012, 0.0), colour=_STEEL, along="y"),
    )
    floor, top = -length - 0.02 - radius, 0.025
    body = (
        Shape("box", (0.02, 0.026, 0.034), (0.0, -0.008, 0.0095), colour=_DARK),
        Shape("box", (0.02, 0.02, top - floor), (0.0, -0.03, 0.5 * (top + floor)), colour=_STEEL),
        Shape("box", (0.1, 0.1, 0.01), (0.0, -0.02, floor), colour=_STEEL),
    )
    links = (Link("base", 0.5, np.zeros(3), 1e-3 * np.eye(3), body), replace(pole, shapes=shapes))
    joint = Joint(
        "joint", "base", "pendulum", np.zeros(3), across, -math.pi, math.pi, servo.no_load, servo.stall, ARMATURE
    )
    return Robot(
        name="pendulum",
        links={link.name: link for link in links},
        joints=(joint,),
        controlled=("joint",),
        gains={"joint": (servo.kp, servo.kd)},
        no_load_speed=1.0,
        supply_voltage=servo.voltage,
        torque_constant={"joint": servo.voltage / servo.no_load},
        encoder_step=ENCODER_STEP,
        torque_unit=torque_unit(servo.stall),
    )


def pendulum() -> Robot:
    """Return the bench at the factory's gain, 400."""
    return xl330_400()


def xl330_100() -> Robot:
    """Return the bench at the firmware gain 100."""
    return bench(Xl330(100.0))


def xl330_200() -> Robot:
    """Return the bench at the firmware gain 200."""
    return bench(Xl330(200.0))


def xl330_400() -> Robot:
    """Return the bench at the firmware gain 400."""
    return bench(Xl330(400.0))


def xl330_800() -> Robot:
    """Return the bench at the firmware gain 800."""
    return bench(Xl330(800.0))


def _line(points: tuple[tuple[float, float], tuple[float, float]], voltage: float) -> float:
    """Return the value at a voltage [V] on the line through two points."""
    (below, low), (above, high) = points
    return low + (voltage - below) * (high - low) / (above - below)
