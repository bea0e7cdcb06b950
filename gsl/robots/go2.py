"""The Unitree Go2 held in the air: twelve joints under its own law tau = Kp (goal - q) - Kd dq/dt, Kp 20 and Kd 1.5.

The order is that of the logs (FL, FR, RL, RR x hip, thigh, calf), not that of the maker's SDK. It has no feet here,
for nothing is claimed of it on the ground.

Sources:
    A  unitreerobotics/unitree_rl_gym, resources/robots/go2/urdf/go2.urdf (BSD-3-Clause): links, joints, limits, shapes.
    B  iit-DLSLab/sim2real-robot-identification (BSD-3-Clause): gains of the logs, torque and speed limits; its search
       ranges of friction.
    C  google-deepmind/mujoco_menagerie, unitree_go2 (BSD-3-Clause): rotor inertia, set by hand; usual posture.
"""

from __future__ import annotations

import numpy as np

from gsl.core.body import Joint, Link, Robot, Shape

KP, KD = 20.0, 1.5  # [N·m/rad], [N·m·s/rad], B
LEGS = ("FL", "FR", "RL", "RR")  # F front, L left
HIP_X, HIP_Y, THIGH_Y, SHANK = 0.1934, 0.0465, 0.0955, 0.213  # [m], A
EFFORT = {"hip": 23.7, "thigh": 23.7, "calf": 45.43}  # [N·m], B; A's 35.55 is the Go1's calf
SPEED = {"hip": 30.1, "thigh": 30.1, "calf": 15.7}  # [rad/s], B
ARMATURE = {"hip": 0.01, "thigh": 0.01, "calf": 0.01 * 1.917**2}  # [kg·m²], C for the hip; by B one motor and its gear
LIMITS = {  # [rad], A
    "hip": (-1.0472, 1.0472),
    "calf": (-2.7227, -0.83776),
    "F_thigh": (-1.5708, 3.4907),
    "R_thigh": (-0.5236, 4.5379),
}
STANCE = {"hip": 0.0, "thigh": 0.9, "calf": -1.8}  # [rad], C

# mass [kg], centre of mass [m], inertia about it [kg·m²] as (xx, yy, zz, xy, xz, yz), of the front left leg; A
_BASE = (6.921, (0.021112, 0.0, -0.005366), (0.02448, 0.098077, 0.107, 0.00012166, 0.0014849, -3.12e-05))
_PARTS = {
    "hip": (0.678, (-0.0054, 0.00194, -0.000105), (0.00048, 0.000884, 0.000596, -3.01e-06, 1.11e-06, -1.42e-06)),
    "thigh": (1.152, (-0.00374, -0.0223, -0.0327), (0.00584, 0.0058, 0.00103, 8.72e-05, -0.000289, 0.000808)),
    "calf": (0.154, (0.00548, -0.000975, -0.115), (0.00108, 0.0011, 3.29e-05, 3.4e-07, 1.72e-05, 8.28e-06)),
    "foot": (0.04, (0.0, 0.0, 0.0), (9.6e-06, 9.6e-06, 9.6e-06, 0.0, 0.0, 0.0)),
}

_WHITE, _DARK, _GREY = (0.93, 0.93, 0.94), (0.16, 0.17, 0.2), (0.5, 0.53, 0.58)

RANGES = {  # where they differ from those of a NAO's class
    "coulomb_friction": {"torque": (0.0, 1.2)},  # B
    "viscous_friction": {"coefficient": (0.0, 2.0)},  # published models: .01 to 2
    "link_mass": {"mass": (0.0, 1.5)},  # 10 % of the robot
}


def go2() -> Robot:
    """Return the robot."""
    links = [Link("base", _BASE[0], np.array(_BASE[1]), _inertia(_BASE[2]), _shapes("base", 1.0))]
    joints: list[Joint] = []
    for leg in LEGS:
        links += [_link(leg, part) for part in _PARTS]
        joints += _joints(leg)
    names = tuple(joint.name for joint in joints if joint.fixed_at is None)
    parts = {f"{part}s" if part != "calf" else "calves": tuple(n for n in names if f"_{part}_" in n) for part in EFFORT}
    return Robot(
        name="go2",
        links={link.name: link for link in links},
        joints=tuple(joints),
        controlled=names,
        groups={"legs": names, **parts},
        gains=dict.fromkeys(names, (KP, KD)),
        no_load_speed=1.0,
        supply_voltage=29.6,  # nominal, of eight cells
        stance={name: STANCE[name.split("_")[1]] for name in names},
        ranges=RANGES,
    )


def _joints(leg: str) -> list[Joint]:
    x, y = HIP_X * _front(leg), _left_sign(leg)
    across, along, down = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -SHANK])
    rows = (
        ("hip", "base", np.array([x, HIP_Y * y, 0.0]), along, LIMITS["hip"]),
        ("thigh", f"{leg}_hip", np.array([0.0, THIGH_Y * y, 0.0]), across, LIMITS[f"{leg[0]}_thigh"]),
        ("calf", f"{leg}_thigh", down, across, LIMITS["calf"]),
    )
    driven = [
        Joint(
            f"{leg}_{part}_joint",
            parent,
            f"{leg}_{part}",
            origin,
            axis,
            *limits,
            SPEED[part],
            EFFORT[part],
            ARMATURE[part],
        )
        for part, parent, origin, axis, limits in rows
    ]
    foot = Joint(f"{leg}_foot_joint", f"{leg}_calf", f"{leg}_foot", down, across, 0.0, 0.0, 0.0, 0.0, fixed_at=0.0)
    return [*driven, foot]


def _link(leg: str, part: str) -> Link:
    """Return a part of a leg: that of the front left one, mirrored left to right, the hip front to rear as well."""
    mass, com, six = _PARTS[part]
    mirror = np.diag([_front(leg) if part == "hip" else 1.0, _left_sign(leg), 1.0])
    return Link(
        f"{leg}_{part}", mass, mirror @ np.array(com), mirror @ _inertia(six) @ mirror, _shapes(part, _left_sign(leg))
    )


def _shapes(part: str, side: float) -> tuple[Shape, ...]:
    """Return the primitives of a link, `side` 1 on the left and -1 on the right; none collides."""
    half = -0.5 * SHANK
    return {
        "base": (
            Shape("box", (0.3762, 0.0935, 0.114), colour=_WHITE),
            Shape("cylinder", (0.05, 0.09), (0.285, 0.0, 0.01), colour=_DARK, along="x"),
            Shape("sphere", (0.047,), (0.293, 0.0, -0.06), colour=_GREY),
        ),
        "hip": (Shape("cylinder", (0.046, 0.04), (0.0, 0.08 * side, 0.0), colour=_GREY, along="y"),),
        "thigh": (Shape("box", (0.034, 0.0245, SHANK), (0.0, 0.0, half), colour=_WHITE),),
        "calf": (
            Shape("cylinder", (0.012, 0.12), (0.008, 0.0, -0.06), colour=_DARK, turn=(0.0, -0.21, 0.0)),
            Shape("cylinder", (0.011, 0.1), (0.015, 0.0, -0.16), colour=_DARK, turn=(0.0, 0.15, 0.0)),
        ),
        "foot": (Shape("sphere", (0.022,), colour=_GREY),),
    }[part]


def _front(leg: str) -> float:
    return 1.0 if leg[0] == "F" else -1.0


def _left_sign(leg: str) -> float:
    return 1.0 if leg[1] == "L" else -1.0


def _inertia(six: tuple[float, ...]) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
