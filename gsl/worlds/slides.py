"""Which logged joints of a world slide: their positions are in metres."""

from __future__ import annotations

from gsl.core.interfaces import World
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.external import ExternalRobot


def list_slides(world: World) -> list[str]:
    """Return the controlled joints that slide, none of a world that has no robot of gsl's."""
    if not isinstance(world, BulletWorld | ExternalRobot):
        return []
    robot = world.body if isinstance(world, ExternalRobot) else world.plant.robot
    return [name for name in robot.controlled if robot.joint(name).slides]
