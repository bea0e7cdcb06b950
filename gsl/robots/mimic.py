"""Joints that follow others (<mimic>): whom, how, and with whose limits.

position = ratio x that of the leader + offset,    through a chain of followers up to a joint that follows none
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from gsl.core.body import Joint
from gsl.errors import ConfigError
from gsl.robots.joint_limits import MEANING, is_limit, is_range
from gsl.robots.urdf_xml import Hinge


class Follows(NamedTuple):
    """Whom a joint follows in the end, and how: ratio, and offset [rad], or [m] of a slide."""

    leader: str
    ratio: float
    offset: float


def leader_of(hinge: Hinge, joints: Mapping[str, Hinge]) -> Follows | None:
    """Return whom a joint follows, None if nobody.

    Raises:
        ConfigError: It follows itself, by way of others.
    """
    if hinge.follows is None:
        return None
    leader, ratio, offset = hinge.follows
    passed = {hinge.name}
    while leader in joints and (above := joints[leader].follows) is not None:
        if leader in passed:
            raise ConfigError(f"joints.{hinge.name}", "follows itself (<mimic>); one of these joints has to lead")
        passed.add(leader)
        leader, ratio, offset = above[0], ratio * above[1], ratio * above[2] + offset
    return Follows(leader, ratio, offset)


def limits_like_leader(hinge: Hinge, follows: Follows, leader: Joint) -> tuple[Hinge, str]:
    """Return a follower with its leader's limits where its own say nothing, and the names of those in a sentence."""
    limit, missing = dict(hinge.limit), []
    if not is_range(limit, slides=hinge.slides):
        ends = (follows.ratio * end + follows.offset for end in (leader.lower, leader.upper))
        limit["lower"], limit["upper"] = sorted(ends)
        missing.append("range")
    for key, value in zip(MEANING[hinge.slides], (leader.effort, leader.max_velocity), strict=True):
        if not is_limit(key, limit.get(key, 0.0), slides=hinge.slides):
            limit[key] = value
            missing.append(key)
    return replace(hinge, limit=limit), ", ".join(missing)
