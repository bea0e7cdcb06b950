"""What a description of a body does not say of its servos, derived from what it says: start values for a diagnosis.

    armature = TIME_CONSTANT effort / velocity      the time in which full torque brings a free rotor up to speed
    kp       = effort / FULL_AT                     full torque at an error of FULL_AT; of a slide see `Joint.size`
    kd       = 2 DAMPING sqrt(kp inertia)           inertia of rotor and of all that the joint carries, others still

`gsl diagnose` fits gains, friction and inertia of every joint anew before it looks for a cause, so that these need to
be right only within a factor of some units.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from gsl.core.body import Joint, Link, Robot, lump
from gsl.core.dynamics import mass_matrix
from gsl.core.setting import settings_of
from gsl.effects.effect import effect_class

TIME_CONSTANT = 0.02  # [s]: .006 (Go2) to .046 (STS3215), see the robots; motors' data sheets say .005 to .05
FULL_AT, SOFTEST = 0.2, 0.9  # [rad]: .02 (NAO) to .9 (XL330 at factory gains)
DAMPING = 0.7  # of an oscillator: hardly any overshoot
LOAD_MASS = 1.0  # of a lone servo's load [kg]; what of it is off the axis is the effect centre_of_mass
INERT = 300.0  # times what a joint moves: a rotor of more is hardly that of its motor
WORTH = 0.5  # of a lone servo's torque that an unknown load may take
NAO = 3.35  # peak torque of a NAO's legs, of which the torque unit is 1 [N·m]
NAO_MASS = 5.0  # [kg]: a tenth of it is the range of an added mass
OF_SERVOS = (
    ("coulomb_friction", "torque"),
    ("stribeck_friction", "torque"),
    ("viscous_friction", "coefficient"),
    ("armature", "inertia"),
)
_HEAVY_ROTORS = (
    "rotors are far heavier than what they move, and the robot may swing: {}; look at effort and velocity of these "
    "joints, say their armature in a robot file, or hold them"
)
_GRAVITY = 9.81  # [m/s²]


def armature_of(effort: float, velocity: float) -> float:
    """Return the rotor inertia at the output [kg·m²] of a motor of some peak torque [N·m] and speed [rad/s]."""
    return TIME_CONSTANT * effort / velocity


def torque_unit(effort: float) -> float:
    """Return the size of servos of some peak torque [N·m] against the NAO's, see `Robot.torque_unit`."""
    return effort / NAO


def with_gains(robot: Robot, settings: Mapping[str, tuple[float | None, float | None]]) -> Robot:
    """Return the robot with gains for all motors: those given, the others derived.

    Args:
        robot: With everything else.
        settings: kp [N·m/rad] and kd [N·m·s/rad] by motor, [N/m] and [N·s/m] of slides, None where it is left open.
    """
    body = lump(robot)
    carried = np.diag(mass_matrix(body, robot.stance))[6:]
    gains, light = {}, list[str]()
    for name, inertia in zip(robot.motors, carried.tolist(), strict=True):
        joint, (kp, kd) = robot.joint(name), settings.get(name, (None, None))
        kp = joint.effort / (FULL_AT * joint.size) if kp is None else kp
        kd = 2.0 * DAMPING * float(np.sqrt(kp * (inertia + joint.armature))) if kd is None else kd
        gains[name] = (kp, kd)
        light += [name] if joint.armature > INERT * inertia and not joint.slides else []
    remarks = robot.remarks if not light else (*robot.remarks, _HEAVY_ROTORS.format(", ".join(light)))
    peak = max(joint.effort * joint.size for joint in map(robot.joint, robot.motors))
    made = replace(robot, gains=gains, torque_unit=torque_unit(peak), remarks=remarks)
    soft = softer_gains(made) if any(kp for kp, _ in settings.values()) else {}
    return replace(made, ranges={**soft, **wider_ranges(made), **made.ranges})


def softer_gains(robot: Robot) -> dict[str, dict[str, tuple[float, float]]]:
    """Return how far down a diagnosis has to look for gains, as ranges of servo_gain; nothing where that is usual.

    Simulators of position servos are often far stiffer than any servo: kp may be as low as that of the softest that we
    know, which has its full torque at an error of SOFTEST, and kd may be lower by as much.
    """
    motors = [robot.joint(name) for name in robot.motors]
    least = min(joint.effort / (SOFTEST * joint.size * robot.gains[joint.name][0]) for joint in motors)
    usual = settings_of(effect_class("servo_gain"))["kp"]
    assert usual.lower is not None and usual.upper is not None
    return {} if least >= usual.lower else {"servo_gain": dict.fromkeys(("kp", "kd"), (least, usual.upper))}


def wider_ranges(robot: Robot) -> dict[str, dict[str, tuple[float, float]]]:
    """Return the ranges of friction, rotors and loads of a robot that is larger than a NAO; nothing of a smaller one.

    Friction and rotors grow with what servos can do, as their calibration does (`Robot.torque_unit`), loads with mass.
    """
    strength, weight = robot.torque_unit, sum(link.mass for link in robot.links.values()) / NAO_MASS
    ranges = {}
    for name, key, factor in [*((*pair, strength) for pair in OF_SERVOS), ("link_mass", "mass", weight)]:
        usual = settings_of(effect_class(name))[key]
        assert usual.lower is not None and usual.upper is not None
        if factor > 1.0:
            ranges[name] = {key: (usual.lower, factor * usual.upper)}
    return ranges


def lone_servos(
    joints: Mapping[str, Joint], inertias: Mapping[str, float]
) -> tuple[dict[str, Link], tuple[Joint, ...]]:
    """Return a tree in which every joint alone turns a load about a level axis, balanced as long as nobody says else.

    Args:
        joints: Their limits and rotors.
        inertias: Of the loads [kg·m²].
    """
    base = Link("base", LOAD_MASS, np.zeros(3), LOAD_MASS * 1e-3 * np.eye(3))
    loads = {name: Link(f"{name}_load", LOAD_MASS, np.zeros(3), inertias[name] * np.eye(3)) for name in joints}
    axis = np.array([0.0, 1.0, 0.0])
    placed = tuple(
        replace(joint, parent="base", child=f"{name}_load", origin=0.1 * number * axis, axis=axis)
        for number, (name, joint) in enumerate(joints.items())
    )
    return {"base": base, **{load.name: load for load in loads.values()}}, placed


def unknown_loads(joints: Mapping[str, Joint]) -> dict[str, dict[str, tuple[float, float]]]:
    """Return how far off the axis the load of a lone servo may be, as ranges of the effect centre_of_mass [m]."""
    far = WORTH * max(joint.effort for joint in joints.values()) / (LOAD_MASS * _GRAVITY)
    return {"centre_of_mass": dict.fromkeys("xz", (-far, far))}
