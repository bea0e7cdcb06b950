"""Speeds that a robot cannot reach: the clock of its log is too fast, or its positions are in another unit.

A replay need not show it: a log whose clock is far too fast is over before a replay has settled.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gsl.core.plant import Plant
from gsl.core.trajectory import Trajectory
from gsl.diagnosis.angles import say
from gsl.storage.signals.finding import MOVES, Finding, Place, per_joint

ROWS = 7  # over which a speed is taken: noise of an encoder hardly counts
BEYOND = 3.0  # times the greatest speed of a joint: gravity and a push drive it beyond that, and not so far
OFTEN = 0.1  # share of the rows in which it moves: a jump of a position, or a fall, is over before


def find_speeds(episodes: Sequence[Trajectory], joints: Sequence[str], plant: Plant) -> list[Finding]:
    """Return the joints that move far faster than they can, by the clock of the log.

    Args:
        episodes: Without wraps and glitches, slides in angles.
        joints: Names, in order.
        plant: Of their robot.
    """
    most = np.array([plant.robot.joint(joint).max_velocity for joint in joints])
    moving, fast, speeds = np.zeros(len(joints)), np.zeros(len(joints)), np.zeros(len(joints))
    places = list[Place]()
    for number, (way, speed) in enumerate(_measure(episodes)):
        moves, beyond = way > MOVES, (way > MOVES) & (speed > BEYOND * most)
        moving, fast = moving + moves.sum(axis=0), fast + beyond.sum(axis=0)
        speeds = np.maximum(speeds, np.where(beyond, speed, 0.0).max(axis=0, initial=0.0))
        places += [Place(int(k), number, int(row)) for row, k in np.argwhere(beyond)]
    often = fast > OFTEN * np.maximum(moving, 1.0)
    remedy = "mend time in the mapping, or the speed of the joint in the robot file"
    findings = per_joint("speed", "position", (place for place in places if often[place.joint]), joints, "", remedy)
    return [finding._replace(problem=_tell(finding, joints, speeds, most, plant)) for finding in findings]


def _measure(episodes: Sequence[Trajectory]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield ways over ROWS rows [rad] and speeds on them [rad/s] of each episode, shape (T - ROWS, n_joints)."""
    for episode in episodes:
        way = np.abs(episode.position[ROWS:] - episode.position[:-ROWS])
        yield way, way / (episode.time[ROWS:] - episode.time[:-ROWS])[:, None]


def _tell(finding: Finding, joints: Sequence[str], speeds: np.ndarray, most: np.ndarray, plant: Plant) -> str:
    k = joints.index(finding.joints[0])
    factor, unit = say(plant.robot, finding.joints, "rad/s")
    times = speeds[k] / most[k]
    return (
        f"moves at up to {factor * speeds[k]:.3g} {unit}, {times:.2g} times what the joint can do "
        f"({factor * most[k]:.3g} {unit}), as if the clock ran too fast"
    )
