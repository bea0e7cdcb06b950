"""The pendulum of pendulum.py with the servo that Rhoban/bam publishes for it; friction is the world's.

    kp = P e stall        kd = kt² / R        stall = kt V / R        no load at V / kt, as the firmware's law has it

bam fitted them to these very logs, at all four gains, and their zero of up to 16 mrad is left out: it is of the bench.

Source: Rhoban/bam, params/xl330 at 11bb7ec (Apache-2.0).
"""

from __future__ import annotations

from dataclasses import replace

from gsl.core.body import Robot
from gsl.robots.pendulum import DUTY_PER_RADIAN, FACTORY_GAIN, Xl330, bench

VOLTAGE = Xl330().voltage


def xl330_bam_m1() -> Robot:
    """Return the bench with friction model M1's motor."""
    return _bam(kt=0.370052, resistance=3.498350, armature=0.001990)


def xl330_bam_m3() -> Robot:
    """Return the bench with friction model M3's motor."""
    return _bam(kt=0.291467, resistance=2.0, armature=0.002596)


def xl330_bam_m4() -> Robot:
    """Return the bench with friction model M4's motor."""
    return _bam(kt=0.291545, resistance=2.0, armature=0.002578)


def _bam(*, kt: float, resistance: float, armature: float) -> Robot:
    stall, ours = kt * VOLTAGE / resistance, bench(Xl330())
    joint = replace(ours.joint("joint"), effort=stall, max_velocity=VOLTAGE / kt, armature=armature)
    gains = {"joint": (FACTORY_GAIN * DUTY_PER_RADIAN * stall, kt**2 / resistance)}
    return replace(ours, joints=(joint,), gains=gains, torque_constant={"joint": kt})
