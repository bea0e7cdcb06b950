"""The SO-101 as MuJoCo Menagerie publishes it: the arm of so101.py with servos about a hundred times as stiff.

Menagerie notes that its gains are no mapping of LeRobot's. A servo of 998 N·m/rad hardly droops and hardly lags; the
firmware's P of 16 without an integral term, which LeRobot sets, comes to 12 N·m/rad (so101.py). Its joints' damping of
.60 N·m·s/rad and friction of .052 N·m are the world's. It is the same robot, and has its name: the logs are of it.

Source: google-deepmind/mujoco_menagerie, robotstudio_so101/so101.xml, class sts3215 (Apache-2.0).
"""

from __future__ import annotations

from dataclasses import replace

from gsl.core.body import Robot
from gsl.robots.so101 import RANGES, so101

KP, KV, FORCE, ARMATURE = 998.22, 2.731, 2.94, 0.028  # [N·m/rad], [N·m·s/rad], [N·m], [kg·m²]
UNLIMITED = 100.0  # times the joints' speed: torque does not fall with speed there


def so101_menagerie() -> Robot:
    """Return the arm with Menagerie's servos; the gains that a diagnosis may find reach down to the firmware's."""
    arm = so101()
    return replace(
        arm,
        joints=tuple(replace(joint, effort=FORCE, armature=ARMATURE) for joint in arm.joints),
        no_load_speed=UNLIMITED,
        gains=dict.fromkeys(arm.controlled, (KP, KV)),
        ranges={**RANGES, "servo_gain": {"kp": (0.004, 1.5), "kd": (0.03, 1.5)}},
    )
