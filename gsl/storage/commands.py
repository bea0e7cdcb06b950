"""Command files: what is to be played open loop on a robot, as a JSON document of episodes.

    {"schema_version": 1, "robot": "nao", "joints": [...], "control_period": 0.02, "about": {...},
     "episodes": [{"name": "knee_steps", "action": [[...], ...]}, ...]}

An action is a row of desired joint positions [rad] in the order of `joints`; a row is held for one control period [s].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.body import Robot
from gsl.core.validation import did_you_mean
from gsl.errors import ArtifactError
from gsl.policies.limits import Limits, breach, limits
from gsl.storage import documents
from gsl.storage.whole import replacing

SCHEMA_VERSION = 1
_KEYS = ("robot", "joints", "control_period", "episodes")


@dataclass(frozen=True)
class Commands:
    """What one command file holds.

    Attributes:
        robot: Name of the robot.
        joints: All its controlled joints: the columns of every action.
        control_period: How long a row is held [s].
        episodes: Names and desired joint positions [rad], each of shape (T, n_joints).
        about: Whatever else is known: who asks for it, and why.
    """

    robot: str
    joints: tuple[str, ...]
    control_period: float
    episodes: tuple[tuple[str, np.ndarray], ...]
    about: Mapping[str, Any] = field(default_factory=dict)


def write_commands(path: Path, commands: Commands) -> None:
    """Write a command file, whole or not at all; numbers come back as they were, to the bit."""
    episodes = [{"name": name, "action": action} for name, action in commands.episodes]
    stored = {**vars(commands), "schema_version": SCHEMA_VERSION, "episodes": episodes}
    with replacing(path) as temporary:
        temporary.write_text(documents.text(stored) + "\n", encoding="utf-8")


def read_commands(path: Path, robot: Robot) -> Commands:
    """Read a command file for a robot; the columns come in the order of the robot's joints.

    Raises:
        ArtifactError: It is damaged, of another version or robot, or asks for what the robot's limits do not allow.
    """
    damaged = "is not a command file, or damaged: it cannot be read as JSON"
    stored = documents.read_versioned(path, SCHEMA_VERSION, damaged)
    if missing := [key for key in _KEYS if key not in stored]:
        raise ArtifactError(path, f"has no {missing[0]}")
    if stored["robot"] != robot.name:
        raise ArtifactError(path, f"is for the robot {stored['robot']!r}, not for {robot.name}")
    period, joints, entries = stored["control_period"], stored["joints"], stored["episodes"]
    if isinstance(period, bool) or not isinstance(period, (int, float)) or not 0.0 < period < float("inf"):
        raise ArtifactError(path, f"control_period {period!r} must be a positive number of seconds")
    order = _order(path, joints, robot.controlled)
    if not isinstance(entries, list) or not entries:
        raise ArtifactError(path, "there is no episode in it")
    bounds = limits(robot)
    episodes = tuple(_episode(path, number, entry, order, bounds, period) for number, entry in enumerate(entries))
    return Commands(robot.name, robot.controlled, float(period), episodes, stored.get("about") or {})


def _order(path: Path, joints: Any, wanted: tuple[str, ...]) -> list[int]:
    """Return the column of each of the robot's joints."""
    if not isinstance(joints, list) or len({str(joint) for joint in joints}) != len(joints):
        raise ArtifactError(path, "joints must be a list of different names")
    for joint in joints:
        if joint not in wanted:
            advice = did_you_mean(str(joint), wanted, listed=True)
            raise ArtifactError(path, f"the robot has no joint called '{joint}'{advice}")
    if missing := [joint for joint in wanted if joint not in joints]:
        raise ArtifactError(path, f"the joint {missing[0]} is missing; name all {len(wanted)} of the robot")
    return [joints.index(joint) for joint in wanted]


def _episode(
    path: Path, number: int, entry: Any, order: list[int], bounds: Limits, period: float
) -> tuple[str, np.ndarray]:
    name = entry.get("name") if isinstance(entry, dict) else None
    if not isinstance(name, str) or not name:
        raise ArtifactError(path, f"episode {number}: has no name")
    try:
        action = np.array(entry.get("action"), dtype=float)
    except (ValueError, TypeError):
        action = np.zeros(0)
    if action.ndim != 2 or action.shape[1] != len(order) or not len(action):
        raise ArtifactError(path, f"episode {name}: action must be rows of {len(order)} numbers, one a joint")
    if (fault := breach(bounds, action[:, order], period)) is not None:
        raise ArtifactError(path, f"episode {name}, row {fault.step}, {fault.joint}: {fault.problem}")
    return name, action[:, order]
