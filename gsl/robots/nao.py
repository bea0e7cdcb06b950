"""The NAO V5/V6 (H25) of primitive shapes: sourced constants and the robot they make.

Sources:
    A  ros-naoqi/nao_robot, nao_description/urdf/naoV50_generated_urdf/nao.urdf (BSD): geometry, masses, centres of
       mass, inertias about them, limits, effort, speed. Only the left side is listed; the right one is its
       mirror image (A's right pelvis and arm tensors and ankle pitch limits are not exact mirrors: symmetrised).
    E  Aldebaran documentation, motor pages: gear ratios 1A 201.3, 1B 130.85, 2A 150.27, 2B 173.22.
    B  Aldebaran documentation, battery page: 21.6 V nominal.
    D  SimSpark SPL, nao.rsg: torque constants from experiments on a real NAO, at the output.
    M  maxon data sheets, RE-max 24 and RE-max 17: rotor inertia about 4.0e-7 and 8.7e-8 kg·m² (winding unknown).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gsl.core.body import Joint, Link, Robot
from gsl.robots.nao_shapes import SHAPES, Triple

HIP_OFFSET_Y, HIP_OFFSET_Z = 0.05, 0.085  # [m] A
THIGH, TIBIA, FOOT_HEIGHT = 0.100, 0.1029, 0.04519  # [m] A

ARMATURE = {  # gear ratio² x rotor inertia [kg·m²], E and M
    "1A": 201.3**2 * 4.0e-7,
    "1B": 130.85**2 * 4.0e-7,
    "2A": 150.27**2 * 8.7e-8,
    "2B": 173.22**2 * 8.7e-8,
}
LEG_GAINS = (
    150.0,
    4.0,
)  # [N·m/rad], [N·m·s/rad]: no published servo gains; chosen with the rotor inertia (docs/reference/worlds.md)
SUPPLY_VOLTAGE = 21.6  # [V] B
TORQUE_CONSTANT = {"1A": 4.3, "1B": 2.8, "2A": 2.5, "2B": 2.5}  # [N·m/A] D
ENCODER_STEP = 2.0 * np.pi / 4096  # [rad] E: 12 bits a turn
ARM_GAINS = (0.35 * LEG_GAINS[0], 0.35 * LEG_GAINS[1])

# name, mass [kg], centre of mass [m], inertia about it [1e-6 kg·m²] as (xx, xy, xz, yy, yz, zz); A
_LINKS = (
    ("torso", 1.04956, (-0.00413, 0.0, 0.04342), (3083.61, 14.3116, -33.0211, 2883.5, -27.0793, 1592.4)),
    ("Neck", 0.07842, (-1e-5, 0.0, -0.02742), (16.0324, 0.00157, 0.00316, 17.0394, -0.05295, 5.53372)),
    ("Head", 0.60533, (-0.00112, 0.0, 0.05258), (957.766, 8.78814, 5.33702, 816.836, -29.9579, 984.976)),
    ("LPelvis", 0.06981, (-0.00781, -0.01114, 0.02661), (23.407, 1.07922, -1.76003, 47.6355, 2.76058, 49.7021)),
    ("LHip", 0.14053, (-0.01549, 0.00029, -0.00515), (23.8445, -0.6536, 7.12893, 60.8246, -0.21407, 54.3691)),
    ("LThigh", 0.38968, (0.00138, 0.00221, -0.05373), (509.844, 2.11296, 56.4129, 465.358, -7.91029, 301.098)),
    ("LTibia", 0.30142, (0.00453, 0.00225, -0.04936), (446.171, 3.70584, -30.9008, 388.084, 6.01953, 185.516)),
    ("LAnkle", 0.13416, (0.00045, 0.00029, 0.00685), (32.2034, -0.00883, 4.27549, 67.943, 0.28485, 54.8269)),
    ("LFoot", 0.17184, (0.02542, 0.0033, -0.03239), (87.2911, 8.71925, -2.10563, 353.024, 0.37346, 412.846)),
    ("LShoulder", 0.09304, (-0.00165, -0.02663, 0.00014), (18.3025, 2.06011, 0.00189, 13.9005, -0.36659, 20.1862)),
    ("LBicep", 0.15777, (0.02455, 0.00563, 0.0033), (87.181, -25.3381, -14.2130, 274.712, 0.47144, 241.812)),
    ("LElbow", 0.06483, (-0.02744, 0.0, -0.00014), (5.59588, 0.00421, 0.29224, 26.6179, -0.00184, 27.6294)),
    ("LForeArm", 0.07761, (0.02556, 0.00281, 0.00076), (24.6746, 3.23152, 1.58221, 38.3837, 0.13919, 35.9708)),
    ("LHand", 0.18533, (0.03434, -0.00088, 0.00308), (68.6477, 0.11547, -2.87254, 135.756, 2.67539, 133.228)),
)

# name, parent, child, origin [m], axis, lower, upper [rad], speed [rad/s], effort [N·m], motor; A
_JOINTS = (
    ("LHipYawPitch", "torso", "LPelvis", (0.0, 0.05, -0.085), (0.0, 0.5**0.5, -(0.5**0.5)),
     -1.14529, 0.740718, 4.16174, 3.348, "1A"),
    ("LHipRoll", "LPelvis", "LHip", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), -0.379435, 0.79046, 4.16174, 3.348, "1A"),
    ("LHipPitch", "LHip", "LThigh", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), -1.53589, 0.48398, 6.40239, 3.023, "1B"),
    ("LKneePitch", "LThigh", "LTibia", (0.0, 0.0, -THIGH), (0.0, 1.0, 0.0), -0.0923279, 2.11255, 6.40239, 3.023, "1B"),
    ("LAnklePitch", "LTibia", "LAnkle", (0.0, 0.0, -TIBIA), (0.0, 1.0, 0.0), -1.18944, 0.922581, 6.40239, 3.023, "1B"),
    ("LAnkleRoll", "LAnkle", "LFoot", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), -0.397761, 0.768992, 4.16174, 3.348, "1A"),
    ("LShoulderPitch", "torso", "LShoulder", (0.0, 0.098, 0.1), (0.0, 1.0, 0.0),
     -2.08567, 2.08567, 8.26797, 1.329, "2A"),
    ("LShoulderRoll", "LShoulder", "LBicep", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0),
     -0.314159, 1.32645, 7.19407, 1.7835, "2B"),
)  # fmt: skip

# name, parent, child, origin [m], axis, angle at which it is held [rad]; A
_HELD = (
    ("HeadYaw", "torso", "Neck", (0.0, 0.0, 0.1265), (0.0, 0.0, 1.0), 0.0),
    ("HeadPitch", "Neck", "Head", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.0),
    ("LElbowYaw", "LBicep", "LElbow", (0.105, 0.015, 0.0), (1.0, 0.0, 0.0), 0.0),
    ("LElbowRoll", "LElbow", "LForeArm", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), -0.0349066),
    ("LWristYaw", "LForeArm", "LHand", (0.05595, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0),
)

_CROUCH = {"HipPitch": -0.375, "KneePitch": 0.845, "AnklePitch": -0.470, "ShoulderPitch": 1.571}  # hips 0.23 m high

CONTROLLED = (
    "LHipYawPitch", "LHipRoll", "LHipPitch", "LKneePitch", "LAnklePitch", "LAnkleRoll",
    "RHipRoll", "RHipPitch", "RKneePitch", "RAnklePitch", "RAnkleRoll",
    "LShoulderPitch", "LShoulderRoll", "RShoulderPitch", "RShoulderRoll",
)  # fmt: skip


def nao() -> Robot:
    """Return the NAO: 15 controlled joints (the paper's section 6.1), the others held."""
    links = [_link(*row) for row in _LINKS]
    joints = [_make_driven(*row) for row in _JOINTS] + [_hold(*row) for row in _HELD]
    links += [_mirror_link(link) for link in links if link.name.startswith("L")]
    joints += [_mirror_joint(joint) for joint in joints if joint.name.startswith("L")]
    legs = tuple(j.name for j in joints if j.fixed_at is None and "Shoulder" not in j.name)
    arms = tuple(name for name in CONTROLLED if "Shoulder" in name)
    return Robot(
        name="nao",
        links={link.name: link for link in links},
        joints=tuple(joints),
        controlled=CONTROLLED,
        coupled={"RHipYawPitch": "LHipYawPitch"},
        groups={"legs": legs, "arms": arms},
        feet={"left": "LFoot", "right": "RFoot"},
        gains={**dict.fromkeys(legs, LEG_GAINS), **dict.fromkeys(arms, ARM_GAINS)},
        supply_voltage=SUPPLY_VOLTAGE,
        torque_constant={
            _right(row[0]) if right else row[0]: TORQUE_CONSTANT[row[-1]] for row in _JOINTS for right in (0, 1)
        },
        encoder_step=ENCODER_STEP,
        stance={f"{side}{joint}": angle for side in "LR" for joint, angle in _CROUCH.items()},
        upright_height=0.2,
    )


def _link(name: str, mass: float, com: Triple, moments: tuple[float, ...]) -> Link:
    xx, xy, xz, yy, yz, zz = (1e-6 * value for value in moments)
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Link(name, mass, np.array(com), inertia, SHAPES.get(name, ()))


def _make_driven(
    name: str, parent: str, child: str, origin: Triple, axis: Triple,
    lower: float, upper: float, speed: float, effort: float, motor: str,
) -> Joint:  # fmt: skip
    return Joint(name, parent, child, np.array(origin), np.array(axis), lower, upper, speed, effort, ARMATURE[motor])


def _hold(name: str, parent: str, child: str, origin: Triple, axis: Triple, angle: float) -> Joint:
    return Joint(name, parent, child, np.array(origin), np.array(axis), angle, angle, 0.0, 0.0, fixed_at=angle)


_MIRROR = np.diag([1.0, -1.0, 1.0])  # in the plane y = 0; an axis is a pseudo-vector and changes sign besides


def _mirror_link(link: Link) -> Link:
    shapes = tuple(replace(shape, centre=tuple(_MIRROR @ np.array(shape.centre))) for shape in link.shapes)
    return Link(_right(link.name), link.mass, _MIRROR @ link.com, _MIRROR @ link.inertia @ _MIRROR, shapes)


def _mirror_joint(joint: Joint) -> Joint:
    """Mirror a left joint: the same angle mirrors a pitch or yaw-pitch motion, the opposite one a roll or yaw."""
    axis = -_MIRROR @ joint.axis
    mirrored = replace(
        joint,
        name=_right(joint.name),
        parent=_right(joint.parent),
        child=_right(joint.child),
        origin=_MIRROR @ joint.origin,
        axis=axis,
    )
    if axis.sum() > 0.0:
        return mirrored
    angle = None if joint.fixed_at is None else -joint.fixed_at
    return replace(mirrored, axis=-axis, lower=-joint.upper, upper=-joint.lower, fixed_at=angle)


def _right(name: str) -> str:
    return "R" + name[1:] if name.startswith("L") else name
