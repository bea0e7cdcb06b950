"""Domain randomisation: another draw of the effect library in every episode, so that nothing relies on one simulator.

Tobin et al.: Domain randomization for transferring deep neural networks from simulation to the real world (2017); Peng
et al.: Sim-to-real transfer of robotic control with dynamics randomization (2018). It knows nothing of the real robot.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from gsl.core.body import Robot
from gsl.core.interfaces import GroundingRun, Prepared, World
from gsl.core.layout import Layout
from gsl.core.setting import Setting, component, setting, settings_of
from gsl.effects.effect import effect_class, list_documented
from gsl.errors import ConfigError
from gsl.grounding.none import NoGrounding
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.randomised import RandomisedWorld

SERVO = (
    *("command_latency", "target_smoothing", "deadband", "servo_gain", "coulomb_friction", "viscous_friction"),
    *("load_friction", "torque_limit", "duty_loss", "armature", "zero_offset"),
)
WIDTHS = (1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.12, 0.08)
BODY = ("link_mass", "centre_of_mass", "gravity_tilt")


@component
class RandomisedEffects:
    """Which effects, and how much of their documented ranges: of each from what does nothing towards both ends.

    Effects act on all joints, or on the base.
    """

    effects: Annotated[tuple[str, ...], setting("names of the effects that are drawn", min_length=1)] = SERVO + BODY
    width: Annotated[
        Annotated[float, setting("", gt=0, le=1)] | Literal["auto"],
        setting("share of each documented range; auto: the widest in which pi0 keeps its feet"),
    ] = "auto"

    def __post_init__(self) -> None:
        """Refuse effects that do not exist or that no number turns up.

        Raises:
            ConfigError: One of them.
        """
        for name in self.effects:
            if not _strengths(settings_of(effect_class(name))):
                raise ConfigError("effects", "has no strength that could be drawn; leave it out", given=name)

    @property
    def widths(self) -> tuple[float, ...]:
        """What to try, the widest first."""
        return WIDTHS if self.width == "auto" else (self.width,)

    def parents(self, path: str) -> Mapping[str, Path]:
        """Return nothing: it is made of no artifact."""
        return {}

    def check(self, world: World) -> None:
        """Refuse a world whose effects cannot be drawn."""
        randomise(world, self, self.widths[0])

    def prepare(self, world: World, settled: Mapping[str, Any]) -> Prepared:
        """Return the world with effects that are drawn, as widely as was settled or set."""
        width = settled.get("width", self.widths[0])
        return Prepared(randomise(world, self, width), NoGrounding())

    def start(self, layout: Layout, rng: np.random.Generator) -> GroundingRun:
        """Refuse to start: the world has to be changed first.

        Raises:
            ConfigError: Always; `randomised` gives the world.
        """
        raise ConfigError("grounding", "its effects are not drawn; a stage that uses it has to do that")


@dataclass(frozen=True)
class Draw:
    """A draw of effects.

    Attributes:
        effects: Their names.
        width: Share of each documented range.
        robot: Whose documented ranges they are; its base carries masses.
    """

    effects: tuple[str, ...]
    width: float
    robot: Robot

    def __call__(self, rng: np.random.Generator) -> Mapping[str, Any]:
        """Return an `effects:` mapping."""
        return {name: self._entry(name, rng) for name in self.effects}

    def _entry(self, name: str, rng: np.random.Generator) -> dict[str, float | str]:
        settings = list_documented(name, self.robot)
        place = {"link": self.robot.base} if "link" in settings else {}
        return {**place, **{key: self._value(setting, rng) for key, setting in _strengths(settings).items()}}

    def _value(self, setting: Setting, rng: np.random.Generator) -> float:
        assert setting.neutral is not None and setting.lower is not None and setting.upper is not None
        low, high = (setting.neutral + self.width * (end - setting.neutral) for end in (setting.lower, setting.upper))
        return float(rng.uniform(low, high))


def randomise(world: Any, settings: RandomisedEffects, width: float) -> RandomisedWorld:
    """Return the world with effects that are drawn anew in every episode.

    Raises:
        ConfigError: Its effects cannot be drawn.
    """
    if not isinstance(world, BulletWorld):
        raise ConfigError("grounding", "only Bullet worlds have effects to draw; take another grounding")
    return RandomisedWorld(world, Draw(settings.effects, width, world.plant.robot))


def _strengths(settings: Mapping[str, Setting]) -> Mapping[str, Setting]:
    return {key: setting for key, setting in settings.items() if setting.neutral is not None}
