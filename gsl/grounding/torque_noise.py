"""Torque noise: the simulator with random loads on its joints, so that nothing is learned that they would upset.

Campanaro et al.: Learning and deploying robust locomotion policies with minimal dynamics randomization (ERFI,
2209.12878): a torque that is drawn at every step, and one that is drawn once an episode. It knows nothing of the real
robot.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from gsl.core.described import describe
from gsl.core.interfaces import GroundingRun, Prepared, World
from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.effects.effect import together
from gsl.errors import ConfigError
from gsl.grounding.none import NoGrounding
from gsl.worlds.bullet import BulletWorld

EFFECT = "torque_noise"
SHARE = "as a share of each joint's torque limit"
ROBUST = "at 0.3 and 0.1 pi0 of the NAO walks on: no fall in 40 episodes, 0.3 cm/s slower"

Widths = Mapping[str, float]
"""Standard deviations of torques [N·m] by scope: `all`, a group such as legs, or a joint."""


@component
class TorqueNoise:
    """How strong it is, as a share of each joint's torque limit: joints that carry more get more."""

    step: Annotated[float, setting(f"standard deviation of what is drawn at every physics step, {SHARE}", ge=0,
                                   lower=0.0, upper=1.0, source=ROBUST)] = 0.3  # fmt: skip
    constant: Annotated[float, setting(f"standard deviation of what is drawn once an episode, {SHARE}", ge=0,
                                       lower=0.0, upper=0.2, source=ROBUST)] = 0.1  # fmt: skip

    def parents(self, path: str) -> Mapping[str, Path]:
        """Return nothing: it is made of no artifact."""
        return {}

    def check(self, world: World) -> None:
        """Refuse a world without torques, or with a joint without a limit."""
        torque_limits(world)

    def prepare(self, world: World, settled: Mapping[str, Any]) -> Prepared:
        """Return the world with this noise in it."""
        return Prepared(self.switch_on(world), NoGrounding())

    def without_margins(self) -> NoGrounding:
        """Return no grounding: noise is all that it is."""
        return NoGrounding()

    def start(self, layout: Layout, rng: np.random.Generator) -> GroundingRun:
        """Refuse to start: the world has to be changed first.

        Raises:
            ConfigError: Always; `switched_on` gives the world.
        """
        raise ConfigError("grounding", "its noise is not switched on; a stage that uses it has to do that")

    def switch_on(self, world: Any) -> Any:
        """Return the world with this noise in it.

        Raises:
            ConfigError: It has no torques, or a joint without a limit.
        """
        limits = torque_limits(world)
        step, constant = ({joint: share * limit for joint, limit in limits.items()} for share in self.shares)
        return with_torque_noise(world, step, constant)

    @property
    def shares(self) -> tuple[float, float]:
        """Of the torque limits, at every step and once an episode."""
        return self.step, self.constant

    @property
    def description(self) -> str:
        """What is done, in a few words."""
        step, constant = (f"{100 * share:g} %" for share in self.shares)
        return f"torque noise of {step} of each joint's limit at every step and {constant} constant in an episode"


def with_torque_noise(world: Any, step: Widths | float, constant: Widths | float) -> Any:
    """Return a world with noise on the torques of its joints, besides what it has.

    Args:
        world: In Bullet.
        step: Standard deviations of what is drawn at every physics step [N·m], by scope, or of all joints.
        constant: And of what is drawn once an episode.

    Raises:
        ConfigError: The world has no torques, or no joint of some name.
    """
    _check(world)
    widths = {
        key: value if isinstance(value, Mapping) else {"all": float(value)}
        for key, value in (("step", step), ("constant", constant))
    }
    scopes = dict.fromkeys(scope for by_scope in widths.values() for scope in by_scope)
    entries = [
        {**{key: float(by_scope.get(scope, 0.0)) for key, by_scope in widths.items()}, "joints": scope}
        for scope in scopes
    ]
    drawn = [entry for entry in entries if entry["step"] or entry["constant"]]
    return replace(world, effects=together([describe(world)["effects"], {EFFECT: drawn}])) if drawn else world


def torque_limits(world: Any) -> Mapping[str, float]:
    """Return the torque limits of a world's controlled joints [N·m].

    Raises:
        ConfigError: It has no torques, or a joint without a limit.
    """
    _check(world)
    plant = world.plant
    limits = dict(zip(plant.robot.motors, plant.servo.limit.tolist(), strict=True))
    for joint in plant.robot.controlled:
        if not np.isfinite(limits[joint]):
            problem = f"{joint} has no torque limit to take a share of; world.effects.torque_noise is in N·m"
            raise ConfigError("grounding", problem)
    return {joint: limits[joint] for joint in plant.robot.controlled}


def _check(world: Any) -> None:
    if not isinstance(world, BulletWorld):
        raise ConfigError("grounding", "only Bullet worlds have torques to add noise to; take grounding=ane")
