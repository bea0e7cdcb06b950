"""Pushes from outside on links of a robot: when they act, and where in Bullet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from gsl.core.body import Robot, carrier
from gsl.core.compiled import compile_inner
from gsl.core.lanes import where
from gsl.core.plant import Plant, Push
from gsl.robots.urdf import principal_axes

ROUNDING = 1e-9  # of a physics step: what sums of periods leave


class Aimed(NamedTuple):
    """A push and where it acts.

    Attributes:
        push: Force and time.
        link: Of the robot without fixed joints.
        point: In that link's inertial frame [m].
    """

    push: Push
    link: str
    point: Sequence[float]


def aim(plant: Plant, loaded: Robot) -> tuple[Aimed, ...]:
    """Find where the pushes of a plant act on the robot as it is loaded.

    Args:
        plant: Its robot may have fixed joints.
        loaded: The same robot without them, with the inertias that Bullet gets.
    """
    return tuple(_aim(push, plant.robot, loaded) for push in plant.pushes)


def overlap(push: Push, time: float, step: float) -> float:
    """Return the share of a physics step in which a push acts, continuous in its start and end.

    Args:
        push: When it acts.
        time: At the beginning of the step, since the episode began [s].
        step: Physics period [s].
    """
    return acting(push.start, push.end, time, step)


@compile_inner
def acting(start: float, end: float, time: float, step: float) -> float:
    """Return the same given start and end of the push [s]; `time` may be lanes."""
    share = (min(end, time + step) - max(start, time)) / step
    return where(share > ROUNDING, share, 0.0)


def apply_push(bullet: Any, client: int, body: int, links: Mapping[str, int], push: Aimed, share: float) -> None:
    """Push for one physics step with a share of the force; `links` are Bullet's numbers, -1 for the base."""
    number = links[push.link]
    if number < 0:
        frame = bullet.getBasePositionAndOrientation(body, client)
    else:
        frame = bullet.getLinkState(body, number, computeForwardKinematics=True, physicsClientId=client)[:2]
    place, _ = bullet.multiplyTransforms(*frame, push.point, (0.0, 0.0, 0.0, 1.0))
    force = (share * push.push.force).tolist()
    bullet.applyExternalForce(body, number, force, place, bullet.WORLD_FRAME, client)


def _aim(push: Push, robot: Robot, loaded: Robot) -> Aimed:
    name, point = carrier(robot, push.link, robot.links[push.link].com)
    link = loaded.links[name]
    return Aimed(push, name, (principal_axes(link.inertia)[1].T @ (point - link.com)).tolist())
