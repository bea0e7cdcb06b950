"""Closed-form kinematics of the NAO's legs: where the ankle is to be, which joint angles put it there.

The three hip axes of a leg meet in one point and the two ankle axes in another, so the leg is a knee hinge between two
ball joints; the shared hip-yaw-pitch angle is given, which leaves five joints for the ankle's position and a flat sole.
"""

from __future__ import annotations

import math

import numpy as np

from gsl.core.compiled import compile_kernel
from gsl.robots.nao import THIGH, TIBIA

_DIAGONAL = 0.5**0.5


@compile_kernel
def leg_angles(ankle: np.ndarray, hip_yaw_pitch: float, side: float, angles: np.ndarray) -> None:
    """Fill `angles` with the five leg joints that put the ankle at a point with the sole parallel to the torso's xy.

    Args:
        ankle: Ankle relative to the hip in torso axes [m], shape (3,); out of reach is drawn back to a straight leg.
        hip_yaw_pitch: The joint that both legs share [rad].
        side: +1 for the left leg, -1 for the right one.
        angles: Result, HipRoll, HipPitch, KneePitch, AnklePitch, AnkleRoll [rad], shape (5,).
    """
    c, s = math.cos(hip_yaw_pitch), math.sin(hip_yaw_pitch)
    u, w = _DIAGONAL, -side * _DIAGONAL  # axis (0, u, w)
    # rotation by hip_yaw_pitch about (0, u, w)
    r00, r01, r02 = c, -w * s, u * s
    r10, r11, r12 = w * s, c + u * u * (1 - c), u * w * (1 - c)
    r20, r21, r22 = -u * s, u * w * (1 - c), c + w * w * (1 - c)
    x = r00 * ankle[0] + r10 * ankle[1] + r20 * ankle[2]
    y = r01 * ankle[0] + r11 * ankle[1] + r21 * ankle[2]
    z = r02 * ankle[0] + r12 * ankle[1] + r22 * ankle[2]
    roll = math.atan2(y, -z)
    down = np.hypot(y, z)  # Python's math.hypot rounds otherwise than a compiled one
    reach = min(np.hypot(down, x), THIGH + TIBIA)
    bend = (THIGH * THIGH + TIBIA * TIBIA - reach * reach) / (2 * THIGH * TIBIA)
    lean = (THIGH * THIGH + reach * reach - TIBIA * TIBIA) / (2 * THIGH * reach)
    knee = math.pi - math.acos(min(1.0, max(-1.0, bend)))
    pitch = -math.atan2(x, down) - math.acos(min(1.0, max(-1.0, lean)))
    # the torso's vertical seen from the tibia: (R0 Rx(roll) Ry(pitch + knee))^T e_z
    cr, sr, ct, st = math.cos(roll), math.sin(roll), math.cos(pitch + knee), math.sin(pitch + knee)
    vy = cr * r21 + sr * r22
    vz = -sr * r21 + cr * r22
    up_x, up_y, up_z = ct * r20 - st * vz, vy, st * r20 + ct * vz
    angles[0], angles[1], angles[2] = roll, pitch, knee
    angles[3], angles[4] = math.atan2(up_x, up_z), -math.asin(min(1.0, max(-1.0, up_y)))
