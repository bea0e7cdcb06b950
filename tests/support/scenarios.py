"""Small scenarios that tests of the stages share: the arm in the air and a short walk."""

from __future__ import annotations

from gsl.grounding.none import NoGrounding
from gsl.policies.linear import Linear
from gsl.policies.walk_engine import WalkEngine
from gsl.report.console import Console
from gsl.rollout.rollout import Scenario
from gsl.tasks.arm import HANGING, JOINTS, Arm
from gsl.tasks.walk import Walk
from gsl.worlds.bullet import BulletWorld

QUIET = Console(json=True)
AIR = BulletWorld(robot="nao", effects={}, floating=False, settle=0.1)
GROUND = BulletWorld(robot="nao", effects={}, settle=0.2)
REACH = Linear(start_at=dict.fromkeys(JOINTS, HANGING))


def arm(role: str = "sim", duration: float = 0.6) -> Scenario:
    """The arm task, a few ticks of it."""
    return Scenario(AIR, Arm(duration=duration), REACH, role, NoGrounding())


def walk(role: str = "sim", duration: float = 0.6) -> Scenario:
    """The first steps of the walk."""
    return Scenario(GROUND, Walk(duration=duration), WalkEngine(), role, NoGrounding())
