"""What lies between the motor's current and the joint's output: torque limits, stops, and a rotor behind a spring."""

from __future__ import annotations

import numpy as np

from gsl.core.compiled import compile_inner
from gsl.core.lanes import where

TOOTH_STIFFNESS = 300.0  # of the gear teeth in contact, if there is play [N·m/rad]: an estimate
STIFFEST = 1e-3  # compliance below which a spring counts as rigid, for at 2 ms it would not be stable [rad/(N·m)]
ROTOR_SHARE = 0.7  # of the armature that is beyond the play; the rest moves with the output and keeps 2 ms stable
SUBSTEPS = 8
STOP_STIFFNESS, STOP_DAMPING = 500.0, 2.0  # of a hard stop [N·m/rad], [N·m·s/rad]: stable at 2 ms with our rotors
DAMPING = 0.2  # of the teeth or the spring, as a share of sqrt(stiffness · inertia)


@compile_inner
def limit_torque(u: float, v: float, bound: float, no_load: float) -> float:
    """Return a motor's torque [N·m] within its limit and, where it drives the motion, below its speed line.

    Args:
        u: Wanted torque [N·m].
        v: Speed [rad/s].
        bound: Torque limit [N·m].
        no_load: Speed at which driving torque vanishes [rad/s].
    """
    share = v / no_load
    high = where(v > 0.0, bound * min(1.0, max(0.0, 1.0 - share)), bound)
    low = where(v < 0.0, bound * min(1.0, max(0.0, 1.0 + share)), bound)
    return min(high, max(-low, u))


@compile_inner
def through_gear(
    rotor: np.ndarray, i: int, motion: np.ndarray, u: float, bound: float, no_load: float, inertia: float,
    play: float, compliance: float, hardness: float, step: float,
) -> float:  # fmt: skip
    """Return the mean torque that arrives at the output [N·m] and move the rotor by one physics step, in substeps.

    With play the teeth push only when the gap is closed, and never pull; without it they are a spring.

    Args:
        rotor: Angles [rad] and speeds [rad/s] of the rotors as seen at the output, shape (2, n_motors), moved on.
        i: Motor.
        motion: Positions [rad] and velocities [rad/s] of the outputs, shape (2, n_motors).
        u: Wanted torque [N·m].
        bound: Torque limit [N·m].
        no_load: Speed at which driving torque vanishes [rad/s].
        inertia: Of the rotor [kg·m²].
        play: Full width [rad].
        compliance: Of the spring [rad/(N·m)]; the teeth themselves count if there is play.
        hardness: Of the teeth against those of a hinge.
        step: Physics period [s].
    """
    q, v, h, half = motion[0, i], motion[1, i], step / SUBSTEPS, 0.5 * play
    stiffness = 1.0 / (compliance + (1.0 / (TOOTH_STIFFNESS * hardness) if play > 0.0 else 0.0))
    damping = DAMPING * np.sqrt(stiffness * inertia)
    angle, speed, passed = rotor[0, i], rotor[1, i], 0.0
    for k in range(SUBSTEPS):
        gap = angle - (q + v * h * k)
        bent = gap - min(half, max(-half, gap))
        push = stiffness * bent + damping * (speed - v)
        if play > 0.0:
            push = where(bent > 0.0, max(0.0, push), where(bent < 0.0, min(0.0, push), 0.0))
        drive = limit_torque(u, speed, bound, no_load)
        speed += h * (drive - push) / inertia
        angle += h * speed
        passed += push / SUBSTEPS
    rotor[0, i], rotor[1, i] = angle, speed
    return passed


@compile_inner
def stop_torque(beyond: float, v: float) -> float:
    """Return the torque of a stop that only pushes back [N·m], `beyond` it [rad] at speed v away from it."""
    return where(beyond > 0.0, -max(0.0, STOP_STIFFNESS * beyond + STOP_DAMPING * v), 0.0)
