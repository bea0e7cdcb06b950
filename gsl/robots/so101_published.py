"""The SO-101 of so101.py with the servos that others publish for it, one function a source; friction is the world's.

Body, limits, the speed at which torque vanishes and, where a source has none, the rotor's inertia are ours.

Sources, all Apache-2.0 but W and D (BSD-3-Clause):
    R  TheRobotStudio/SO-ARM100, Simulation/SO101/joints_properties.xml at 53f2b75, taken from Open_Duck_Playground:
       kp 17.8, kv 0, forces up to 3.35 N·m. Its damping of .60 is the world's.
    W  isaac-sim/Sim-to-Real-SO-101-Workshop, assets/so101.py, `workshop`: gains by hand, 30 N·m, no friction, no rotor.
    A  the same file, `anchorbench_sysid`: the system identification that Isaac Lab's SO-101 has since #7483.
    D  nvidia/Anchor-Lab, robot_assets/so101_no_camera_new_calib.usd: the drives in the file, which Isaac Lab's keyboard
       task has as profile `usd_drive`: 100 and 1 for all joints, 10 N·m, no friction, no rotor.
    T  NVIDIA/so101-typing-task, tasks/SO101/data/gtc_berlin.yaml at 7aec2ed: a system identification of another arm,
       best mean squared error 1.07e-4 rad²; it has no limit of the torque, which is that of A here.
    B  Rhoban/bam, params/feetech_sts3215_7_4V (7.4 V) and feetech/actuator.py, here at the register P of 16 that the
       logs have: kp = P .166 ratio stall, kd = kt² / R, stall = .97 kt 7.4 V / R.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gsl.core.body import Robot
from gsl.robots.so101 import ARMATURE, GAIN, so101

BAM_DUTY, BAM_MOST, BAM_VOLTAGE = 0.166, 0.97, 7.4  # duty per radian and P, greatest duty, [V]; B


def so101_robotstudio() -> Robot:
    """Return the arm with TheRobotStudio's servos, R."""
    return _arm([17.8] * 6, [0.0] * 6, 3.35, [0.028] * 6)


def so101_workshop() -> Robot:
    """Return the arm with the servos of NVIDIA's workshop, W."""
    return _arm([55.0, 30.0, 25.0, 12.0, 7.0, 4.0], [0.7, 0.8, 0.7, 0.5, 0.5, 0.3], 30.0, [ARMATURE] * 6)


def so101_anchor_lab() -> Robot:
    """Return the arm with the servos of NVIDIA's system identification, A."""
    return _arm(
        [48.419899, 47.782635, 14.715496, 43.607166, 54.873917, 68.250793],
        [3.334595, 2.563165, 0.343250, 4.139243, 2.968392, 2.818730],
        3.35,
        [0.067620, 0.027645, 0.037720, 0.050714, 0.054898, 0.077625],
    )


def so101_usd_drive() -> Robot:
    """Return the arm with the drives of NVIDIA's USD file, D."""
    return _arm([100.0] * 6, [1.0] * 6, 10.0, [ARMATURE] * 6)


def so101_typing_task() -> Robot:
    """Return the arm with the servos of NVIDIA's typing task, T."""
    return _arm(
        [48.936821, 51.336504, 18.565406, 43.033807, 47.135886, 50.830540],
        [2.309705, 2.782963, 0.534694, 2.719132, 1.789519, 2.345108],
        3.35,
        [0.058228, 0.044253, 0.054507, 0.051103, 0.051382, 0.043380],
    )


def so101_bam_m1() -> Robot:
    """Return the arm with bam's servo of 7.4 V, friction model M1, B."""
    return _bam(kt=1.177631, resistance=2.478682, ratio=1.004937, armature=0.026083)


def so101_bam_m3() -> Robot:
    """Return the arm with bam's servo of 7.4 V, friction model M3, B."""
    return _bam(kt=1.264970, resistance=2.452907, ratio=1.178706, armature=0.023497)


def so101_bam_m4() -> Robot:
    """Return the arm with bam's servo of 7.4 V, friction model M4, B."""
    return _bam(kt=1.265258, resistance=2.472371, ratio=1.179917, armature=0.023358)


def _bam(*, kt: float, resistance: float, ratio: float, armature: float) -> Robot:
    full = kt * BAM_VOLTAGE / resistance  # torque at full duty [N·m]
    kp, kd = GAIN * BAM_DUTY * ratio * full, kt**2 / resistance
    return _arm([kp] * 6, [kd] * 6, BAM_MOST * full, [armature] * 6)


def _arm(kp: Sequence[float], kd: Sequence[float], limit: float, armature: Sequence[float]) -> Robot:
    """Return the arm with other gains, a limit of the torque [N·m] and rotors [kg·m²], joints from the base on."""
    ours = so101()
    inertia = dict(zip(ours.controlled, armature, strict=True))
    joints = tuple(replace(joint, effort=limit, armature=inertia[joint.name]) for joint in ours.joints)
    gains = dict(zip(ours.controlled, zip(kp, kd, strict=True), strict=True))
    return replace(ours, joints=joints, gains=gains)
