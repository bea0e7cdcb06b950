"""The motions of a next experiment: all that a command file can hold, as targets that keep a robot's limits.

What a command file cannot do is not among them: a torso turned round, a weight in a hand, another supply voltage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gsl.core.body import Robot
from gsl.diagnosis.settings import DesignSettings
from gsl.policies.excitation import MENU, VARIANTS, Excitation, Motion, slow_down
from gsl.policies.limits import Limits, limits
from gsl.policies.sides import pairs

OWN: tuple[tuple[str, Motion, dict[str, Any]], ...] = (
    ("steps_tiny", "steps_small", {"amplitude": 0.4}),
    ("triangle_creeping", "triangle_slow", {"amplitude": 0.15}),
    ("chirp_long", "chirp", {"duration": 10.0}),
    ("poses_long", "poses", {"duration": 15.0}),
)
"""Motions of the excitation with settings of their own: for stiction, for inertia, for what comes with time."""
EXCURSION = 1.6  # there and back at one end of a range [s]: slow enough for half the speed of a NAO's motors
REST = 0.4  # before the first and after the last excursion [s]


@dataclass(frozen=True)
class Choice:
    """One motion to choose.

    Attributes:
        name: What it is called.
        variants: Names and desired joint positions [rad] of its variants, one to fit and one to check, (T, n_joints).
    """

    name: str
    variants: tuple[tuple[str, np.ndarray], ...]

    def scale(self, factors: np.ndarray) -> Choice:
        """Return the same with joints that go so many times as far, shape (n_joints,)."""
        return Choice(self.name, tuple((name, factors * targets) for name, targets in self.variants))

    @property
    def ticks(self) -> int:
        """Control periods of the first variant."""
        return len(self.variants[0][1])

    @property
    def episodes(self) -> tuple[tuple[str, np.ndarray], ...]:
        """All variants, and the first one again: its repeat shows the noise."""
        return (*self.variants, self.variants[0])


def motions(robot: str, body: Robot, period: float, **settings: Any) -> tuple[Choice, ...]:
    """Return what can be played.

    Args:
        robot: Name of the robot, as an excitation takes it.
        body: The same robot.
        period: Control period [s].
        **settings: Of the excitation, such as its `duration`.
    """
    ways: list[tuple[str, Motion, dict[str, Any]]] = [(motion, motion, settings) for motion in MENU]
    ways += [(name, motion, settings | own) for name, motion, own in OWN]
    choices = [_choice(name, motion, Excitation(robot=robot, **how), period) for name, motion, how in ways]
    bounds = Excitation(robot=robot).limits
    ends = [(f"ends_{variant}", to_the_ends(bounds, body, period, back=variant == "b")) for variant in VARIANTS]
    return (*choices, Choice("ends", tuple(ends)))


def _choice(name: str, motion: Motion, excitation: Excitation, period: float) -> Choice:
    variants = [(f"{name}_{variant}", excitation.commands(motion, variant, period)) for variant in VARIANTS]
    return Choice(name, tuple(variants))


def to_the_ends(bounds: Limits, body: Robot, period: float, *, back: bool = False) -> np.ndarray:
    """Return slow excursions to both ends of each joint's room, mirrored joints together [rad], shape (T, n_joints).

    Args:
        bounds: Of the joints.
        body: Whose sides are mirrored.
        period: Control period [s].
        back: Whether the last joint comes first, and the lower end before the upper one.
    """
    partner = {pair.right: pair.left for pair in pairs(body)}
    leaders = [k for k in range(len(bounds.joints)) if k not in partner]
    turns = [(k, end) for k in leaders for end in (1.0, -1.0)][:: -1 if back else 1]
    pause, length = round(REST / period), round(EXCURSION / period)
    bump = 0.5 * (1.0 - np.cos(2.0 * np.pi * np.arange(1, length + 1) / length))
    way = np.zeros((2 * pause + length * len(turns), len(bounds.joints)))
    signs = {pair.right: pair.sign for pair in pairs(body)}
    for number, (leader, end) in enumerate(turns):
        begin = pause + number * length
        for k in (leader, *(right for right, left in partner.items() if left == leader)):
            side = end * signs.get(k, 1.0)
            way[begin : begin + length, k] = side * (bounds.up[k] if side > 0.0 else bounds.down[k]) * bump
    return bounds.rest + slow_down(way, bounds.speed * period)


def ladder(
    climbs: Sequence[tuple[str, tuple[float, float]]],
    robot: Robot,
    period: float,
    settings: DesignSettings | None = None,
) -> Choice:
    """Return a ladder of poses, on which one joint after the other rests at rungs, so that loads show alone.

    The second variant goes the other way round.

    Args:
        climbs: Joints, each with the positions between which its rungs are [rad].
        robot: Theirs.
        period: Control period [s].
        settings: How many rungs, and how long each is held.
    """
    bounds, how = limits(robot), settings or DesignSettings()
    up = np.concatenate([_climb(bounds, *climb, period, how) for climb in climbs])
    down = np.concatenate([_climb(bounds, joint, ends[::-1], period, how) for joint, ends in reversed(climbs)])
    return Choice("pose_ladder", (("pose_ladder_a", up), ("pose_ladder_b", down)))


def _climb(bounds: Limits, joint: str, ends: tuple[float, ...], period: float, how: DesignSettings) -> np.ndarray:
    """Return the way of one joint from rest over its rungs and back, the others at rest [rad], shape (T, n_joints)."""
    k = bounds.joints.index(joint)
    rungs = np.linspace(ends[0], ends[1], how.rungs)
    stops = [bounds.rest[k], *rungs, bounds.rest[k]]
    way = []
    for begin, end in zip(stops[:-1], stops[1:], strict=True):
        fastest = np.pi / 2.0 * abs(end - begin) / bounds.speed[k]  # of a cosine, whose middle is the steepest
        ticks = max(1, round(max(how.way, 1.1 * fastest) / period))
        share = 0.5 * (1.0 - np.cos(np.pi * np.arange(1, ticks + 1) / ticks))
        way.append(begin + (end - begin) * share)
        way.append(np.full(round(how.hold / period), end))
    path = np.concatenate(way)
    targets = np.repeat(bounds.rest[None], len(path), axis=0)
    targets[:, k] = path
    return targets
