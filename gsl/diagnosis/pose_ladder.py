"""A ladder of poses: one joint after the other goes through positions and rests at each, so that loads show alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gsl.core.body import Robot
from gsl.diagnosis.menu import Dish
from gsl.policies.limits import Limits, limits

RUNGS = 5  # of each joint
HOLD, WAY = 0.8, 0.8  # of a rung, and least time from one to the next [s]


def ladder(climbs: Sequence[tuple[str, tuple[float, float]]], robot: Robot, period: float) -> Dish:
    """Return held rungs between the ends of one joint after the other, the other way round in the second variant.

    Args:
        climbs: Joints, each with the positions between which its rungs are [rad].
        robot: Theirs.
        period: Control period [s].
    """
    bounds = limits(robot)
    up = np.concatenate([_climb(bounds, *one, period, reverse=False) for one in climbs])
    down = np.concatenate([_climb(bounds, *one, period, reverse=True) for one in reversed(climbs)])
    return Dish("pose_ladder", (("pose_ladder_a", up), ("pose_ladder_b", down)))


def _climb(bounds: Limits, joint: str, ends: tuple[float, float], period: float, *, reverse: bool) -> np.ndarray:
    k = bounds.joints.index(joint)
    rungs = np.linspace(*(ends[::-1] if reverse else ends), RUNGS)
    stops = [bounds.rest[k], *rungs, bounds.rest[k]]
    way = []
    for begin, end in zip(stops[:-1], stops[1:], strict=True):
        fastest = np.pi / 2.0 * abs(end - begin) / bounds.speed[k]  # of a cosine, whose middle is the steepest
        ticks = max(1, round(max(WAY, 1.1 * fastest) / period))
        share = 0.5 * (1.0 - np.cos(np.pi * np.arange(1, ticks + 1) / ticks))
        way.append(begin + (end - begin) * share)
        way.append(np.full(round(HOLD / period), end))
    path = np.concatenate(way)
    targets = np.repeat(bounds.rest[None], len(path), axis=0)
    targets[:, k] = path
    return targets
