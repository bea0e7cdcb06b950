"""The SO-101 arm with six STS3215 servos at 12 V, from published dimensions and masses, as its logs see it.

The joints have the names of the logs of isaac-sim2real/sage (Rotation to Jaw), and A's zeros and signs: the upper arm
upright, forearm and gripper level. How sure that is: the collector writes degrees from the middle of each calibrated
range, as A does, and LeRobot uses A with the same degrees. Of the logs' own evidence, at slow speed on three dates,
Pitch, Elbow and Wrist_Pitch stand off their commands to the side to which A's gravity pulls, by 50 to 120 mrad/(N·m),
which bears out their signs as long as no zero is off by more than 40 mrad; a free zero leaves Pitch open, since it
never moves far enough for its load to change. Nothing but convention speaks for the signs of Rotation and Wrist_Roll,
which gravity hardly loads. Jaw is logged from 0 to 1 and taken to run over A's range, 0 closed.

The firmware drives the motor with a duty in proportion to the error, P times .165 for each radian at a register P (B,
by oscilloscope), and LeRobot and the collector set P 16, I 0, D 32. In the terms of our servo (worlds/servo.py)

    kp = P .165 stall        kd = stall / no_load

with the stall torque before friction: 11.7 N·m/rad and .94 N·m·s/rad. Calibrated around that the logs say 11 to 14;
with the gain free they say 10 to 30 (docs/howto/shipped-logs.md).

The torque's limit, at full duty, is before friction too: friction is the world's, by its effects or as a diagnosis
calibrates it, and must not be taken off twice. At the output 2.94 N·m arrive of 4.45 (C). The world so101 has .052 of
the difference; the rest is friction of the gears under load, the effect load_friction, whose coefficient m leaves
(1 - m) / (1 + m): .20 by these figures, .12 by the 35 kg·cm measured in C, .29 to .30 in B's larger models. Without it
the arm is too strong where it stalls, at errors beyond .38 rad.

Without the integral term gravity droop stays. D is left out: the register's scale is not published, and kd / kp alone
is a lag of 80 ms; that of the logs' quick motions is 61 to 134 ms by correlation (`gsl import --check`).

Sources:
    A  TheRobotStudio/SO-ARM100, Simulation/SO101/so101_new_calib.urdf (Apache-2.0): links, joints, limits. Masses are
       those of the CAD at an assumed density; its effort and velocity of 10 are placeholders.
    B  kscalelabs/sysid, STS3215 at 12 V: duty per error, stall torque before friction, rotor inertia, from a bench.
    C  SO-ARM100 issues 132 and 134: 30 kg·cm and 45 rpm at 12 V (measured there: 35 and 46); 1 degree of play.
    D  google-deepmind/mujoco_menagerie, robotstudio_so101 (Apache-2.0): the boxes (so101_shapes.py).
    E  isaac-sim2real/sage logs (Apache-2.0), of which ranges of effects are wide enough to hold the published causes.
"""

from __future__ import annotations

import math

import numpy as np

from gsl.core.body import Joint, Link, Robot
from gsl.robots.defaults import torque_unit
from gsl.robots.frames import Mount, align, euler
from gsl.robots.so101_shapes import SHAPES

GAIN = 16.0  # register P, E
DUTY_PER_RADIAN = 0.165  # and unit of P, B
STALL = 4.45  # before friction [N·m], B
TORQUE = 2.94  # that arrives at the output [N·m], C: the size of the servo by which friction is measured
NO_LOAD = 4.71  # [rad/s], C
ARMATURE = 0.0278  # [kg·m²], B
TORQUE_CONSTANT = 1.08  # [N·m/A], the data sheet's, C
SUPPLY_VOLTAGE = 12.0  # [V]
ENCODER_STEP = 2.0 * math.pi / 4096.0  # [rad]

KP, KD = GAIN * DUTY_PER_RADIAN * STALL, STALL / NO_LOAD  # [N·m/rad], [N·m·s/rad]

# name, mass [kg], centre of mass [m], inertia about it [kg·m²] as (xx, yy, zz, xy, xz, yz); A
_LINKS = (
    ("base", 0.147, (0.0137179, -5.19711e-05, 0.0334843),
     (1.14686e-04, 1.36117e-04, 1.30364e-04, -4.59787e-07, 4.97151e-06, 9.75275e-08)),
    ("shoulder", 0.100006, (-0.0307604, -1.66727e-05, -0.0252713),
     (8.3759e-05, 8.10403e-05, 2.39783e-05, 7.55525e-08, -1.16342e-06, 1.54663e-07)),
    ("upper_arm", 0.103, (-0.0898471, -0.00838224, 0.0184089),
     (4.08002e-05, 1.47318e-04, 1.42487e-04, -1.97819e-05, -4.03016e-08, 8.97326e-09)),
    ("lower_arm", 0.104, (-0.0980701, 0.00324376, 0.0182831),
     (2.87438e-05, 1.59844e-04, 1.4529e-04, 7.41152e-06, 1.26409e-06, -4.90188e-08)),
    ("wrist", 0.079, (-1.03312e-04, -0.0386143, 0.0281156),
     (3.68263e-05, 2.5391e-05, 2.1e-05, 1.7893e-08, -5.28128e-08, 3.6412e-06)),
    ("gripper", 0.087, (2.13627e-04, 2.45138e-04, -0.025187),
     (2.75087e-05, 4.33657e-05, 3.45059e-05, -3.35241e-07, -5.7352e-06, -5.17847e-08)),
    ("moving_jaw", 0.012, (-0.00157495, -0.0300244, 0.0192755),
     (6.61427e-06, 1.89032e-06, 5.28738e-06, -3.19807e-07, -5.90717e-09, -1.09945e-07)),
)  # fmt: skip

_QUARTER = 0.5 * math.pi

# name, parent, child, origin [m], roll, pitch, yaw, lower, upper [rad]; all turn about their child's z; A
_JOINTS = (
    ("Rotation", "base", "shoulder", (0.0388353, 0.0, 0.0624), (math.pi, 0.0, -math.pi), -1.91986, 1.91986),
    ("Pitch", "shoulder", "upper_arm", (-0.0303992, -0.0182778, -0.0542), (-_QUARTER, -_QUARTER, 0.0),
     -1.74533, 1.74533),
    ("Elbow", "upper_arm", "lower_arm", (-0.11257, -0.028, 0.0), (0.0, 0.0, _QUARTER), -1.69, 1.69),
    ("Wrist_Pitch", "lower_arm", "wrist", (-0.1349, 0.0052, 0.0), (0.0, 0.0, -_QUARTER), -1.65806, 1.65806),
    ("Wrist_Roll", "wrist", "gripper", (0.0, -0.0611, 0.0181), (_QUARTER, 0.0486795, math.pi), -2.74385, 2.84121),
    ("Jaw", "gripper", "moving_jaw", (0.0202, 0.0188, -0.0234), (_QUARTER, 0.0, 0.0), -0.174533, 1.74533),
)  # fmt: skip

RANGES = {  # where they differ from those of a NAO's class
    "command_latency": {"delay": (0.0, 0.15)},  # E: 61 to 134 ms of lag in all
    "target_smoothing": {"time_constant": (0.0, 0.12)},  # E: smoothing in the firmware
    "backlash": {"width": (0.0, 0.05)},  # C and robonine.com: .015 to .023, loaded .031 to .045
    "viscous_friction": {"coefficient": (0.0, 0.6)},  # B: the whole damping is .94 to 1.8
}


def so101() -> Robot:
    """Return the arm: six joints, the base fixed."""
    links = {name: Link(name, mass, np.array(com), _inertia(*six), SHAPES[name]) for name, mass, com, six in _LINKS}
    frames, joints = align(links, [_mount(*row) for row in _JOINTS])
    names = tuple(joint.name for joint in joints)
    return Robot(
        name="so101",
        links=frames,
        joints=joints,
        controlled=names,
        groups={"arm": names[:3], "wrist": names[3:5]},
        gains=dict.fromkeys(names, (KP, KD)),
        no_load_speed=1.0,
        supply_voltage=SUPPLY_VOLTAGE,
        torque_constant=dict.fromkeys(names, TORQUE_CONSTANT),
        encoder_step=ENCODER_STEP,
        ranges=RANGES,
        torque_unit=torque_unit(TORQUE),
    )


def _mount(
    name: str, parent: str, child: str, origin: tuple[float, float, float], attitude: tuple[float, float, float],
    lower: float, upper: float,
) -> Mount:  # fmt: skip
    axis = np.array([0.0, 0.0, 1.0])
    joint = Joint(name, parent, child, np.array(origin), axis, lower, upper, NO_LOAD, STALL, ARMATURE)
    return Mount(joint, euler(*attitude))


def _inertia(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> np.ndarray:
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
