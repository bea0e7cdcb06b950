"""The SO-101 of so101.py with the servos that MuJoCo Menagerie publishes for it: 85 times as stiff.

    kp 998.22 N·m/rad        kv 2.731 N·m·s/rad        forces up to 2.94 N·m        rotor .028 kg·m²

Menagerie says of them that they are "not a 1-to-1 mapping of the servo gains used in Lerobot" and "were calculated ...
assuming that the servo proportional gain is set to 16". So both are derived from a register P of 16: so101.py by the
duty per error that was measured on a bench, 11.7 N·m/rad. The joints' damping of .60 N·m·s/rad and friction of .052 N·m
are the world's. Body, limits and engine are ours, and so is the speed at which torque vanishes. It is the same robot
and has its name, which its logs bear.

Source: google-deepmind/mujoco_menagerie, robotstudio_so101/so101.xml at 191a7ba, class sts3215 (Apache-2.0).
"""

from __future__ import annotations

from dataclasses import replace

from gsl.core.body import Robot
from gsl.robots.defaults import softer_gains
from gsl.robots.so101 import so101

KP, KV, FORCE, ARMATURE = 998.22, 2.731, 2.94, 0.028


def so101_menagerie() -> Robot:
    """Return the arm with Menagerie's servos."""
    ours = so101()
    joints = tuple(replace(joint, effort=FORCE, armature=ARMATURE) for joint in ours.joints)
    gains = dict.fromkeys(ours.controlled, (KP, KV))
    arm = replace(ours, joints=joints, gains=gains)
    return replace(arm, ranges={**arm.ranges, **softer_gains(arm)})
