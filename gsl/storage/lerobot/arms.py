"""What is known of LeRobot's arms beyond their data sets: names of joints, where zero is, a gripper's range.

Sources: lerobot/robots/so_follower and koch_follower (joints, their scales), its page backwardcomp (zeros and
signs before May 2025, when names began with `main_`), and gsl/robots/so101.py (names and ranges of the world so101).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

OURS: Mapping[str, str] = {
    "Rotation": "shoulder_pan",
    "Pitch": "shoulder_lift",
    "Elbow": "elbow_flex",
    "Wrist_Pitch": "wrist_flex",
    "Wrist_Roll": "wrist_roll",
    "Jaw": "gripper",
}
"""Joint of the world so101 -> joint of an SO-100 or SO-101 in LeRobot."""
JAW_CLOSED, JAW_STROKE = -0.174533, 1.919863  # of the published URDF [rad]; LeRobot's gripper is 0 closed and 100 open
OLD = "main_"  # in names of data sets from before the change of zeros


class Zero(NamedTuple):
    """Where an older data set had a joint's zero [degrees], and which way it turned."""

    zero: float
    sign: float


OLD_ZEROS: Mapping[str, Zero] = {"shoulder_lift": Zero(90.0, -1.0), "elbow_flex": Zero(90.0, 1.0)}
"""Of the SO arms, by LeRobot's joint; the others are as today."""


def family(robot: str) -> str | None:
    """Return so100, so101 or koch for what a data set calls its robot, None if it is no such arm."""
    name = robot.lower().replace("-", "").replace("_", "")
    if "koch" in name:
        return "koch"
    return next((arm for arm in ("so101", "so100") if arm in name), "so101" if "sofollower" in name else None)


def bare(entry: str) -> str:
    """Return the joint that an entry of a list is of: shoulder_pan for main_shoulder_pan and shoulder_pan.pos."""
    return entry.removesuffix(".pos").replace(OLD, "", 1)


def motor(entry: str) -> str:
    """Return the motor's name on its bus; the two arms of a pair have the same."""
    return bare(entry).removeprefix("left_").removeprefix("right_").removeprefix("arm_")


def is_gripper(entry: str) -> bool:
    """Tell whether an entry is a gripper's, which LeRobot always logs from 0 to 100."""
    return motor(entry) == "gripper"
