"""A learned servo: the simulator whose joints are as strong, as late and as soft as those of the robot.

The world changes, the actions do not, but for noise that is asked for: the law acts on the torque of every joint at
every physics step (gsl/core/servo_law.py), where a grounded action acts once a tick on where the joint shall go.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from gsl.core.interfaces import Grounding, GroundingRun, Prepared, World
from gsl.core.layout import Layout
from gsl.core.other_commands import gains_of
from gsl.core.setting import component, setting
from gsl.effects.effect import together
from gsl.errors import ConfigError
from gsl.grounding.ane import ActionNoise
from gsl.grounding.none import NoGrounding
from gsl.grounding.torque_noise import with_torque_noise
from gsl.models.servo import other_base
from gsl.models.servo_file import MAKER, read_members, read_servo
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.storage.references import resolve
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.ensemble import EnsembleWorld
from gsl.worlds.fits import check_replayable

# Of a joint's torque limit, at every step and constant: motions in the air do not show what loads of the ground do.
# Chosen for gain and falls together in searches on three other worlds (docs/results/servo.md).
LEAST_NOISE = (0.2, 0.06)
MEMBERS = 4  # of the ensemble that a chain learns: as many as rollouts that a candidate usually has at most


@component
class LearnedServo:
    """Which servo to take, and what noise to add; a chain learns one of its own."""

    servo: Annotated[str, setting("path or run of train-servo")] = ""
    torque_noise: Annotated[
        float,
        setting("torque noise on top; 1 is what held-out motions leave unexplained, at least 0.2 of the limit", ge=0),
    ] = 0.0
    ensemble: Annotated[bool, setting("each episode is with another member of the servo, of several")] = False
    noise: Annotated[float, setting("action noise on top", unit="rad", ge=0)] = 0.0

    def parents(self, path: str) -> Mapping[str, Path]:
        """Return the artifact of train-servo."""
        return {f"{path}.servo": resolve(self.servo, kind=MAKER)}

    def prepare(self, world: World, settled: Mapping[str, Any]) -> Prepared:
        """Return the world with the learned servo, and action noise if it was asked for."""
        return Prepared(self.at_its_place().switch_on(world), self.actions)

    def at_its_place(self) -> LearnedServo:
        """Return the same with its servo named by its folder, whatever run or file it was asked for by."""
        place = resolve(self.servo, kind=MAKER)
        return replace(self, servo=str(place.parent if place.is_file() else place))

    def without_margins(self) -> LearnedServo:
        """Return its first member alone, without noise."""
        return replace(self, torque_noise=0.0, noise=0.0, ensemble=False)

    def start(self, layout: Layout, rng: np.random.Generator) -> GroundingRun:
        """Refuse to start: the world has to be changed first.

        Raises:
            ConfigError: Always; `switched_on` gives the world.
        """
        raise ConfigError("grounding", "its servo is not switched on; a stage that uses it has to do that")

    @property
    def members(self) -> int:
        """How many members a chain learns."""
        return MEMBERS if self.ensemble else 1

    def switch_on(self, world: Any) -> BulletWorld | EnsembleWorld:
        """Return the world with the learned servo, or with its members in turn.

        Raises:
            ConfigError: There is no servo, it was learned on top of another one, or the world cannot have one.
        """
        checked = self.check(world)
        if not self.servo:
            raise ConfigError("grounding.servo", "is missing; name a run of gsl train-servo")
        model = read_servo(self.servo)
        if other_base(checked.plant, model):  # one of a log that has its gains stands on these
            place = Path(self.at_its_place().servo)
            about = Artifact(place, manifest.read(place)).metrics if (place / manifest.NAME).is_file() else {}
            checked = replace(checked, effects=together([checked.effects, gains_of(about)]))
        if other := other_base(checked.plant, model):
            raise ConfigError("grounding.servo", f"was learned on top of another servo: {other}", given=self.servo)
        first = self.shaken(replace(checked, servo=self.servo))
        if not self.ensemble:
            return first
        count = len(read_members(self.servo).members)
        if count == 1:
            problem = f"{self.servo} has one member; gsl train-servo members={MEMBERS} makes more"
            raise ConfigError("grounding.ensemble", problem, given="true")
        return EnsembleWorld(first, tuple(replace(first, servo_member=k) for k in range(count)))

    def shaken(self, world: BulletWorld) -> BulletWorld:
        """Return a world with its learned servo and the torque noise that was asked for."""
        if not self.torque_noise:
            return world
        model, limit = read_servo(self.servo), world.plant.servo.limit[:, None]
        least = np.where(np.isfinite(limit), limit * LEAST_NOISE, 0.0)
        widths = self.torque_noise * np.maximum(model.noise, least)  # (n_motors, 2)
        joints = world.plant.robot.controlled  # coupled motors follow them
        step, constant = (dict(zip(joints, column.tolist(), strict=False)) for column in widths.T)
        noisy: BulletWorld = with_torque_noise(world, step, constant)
        return noisy

    def check(self, world: Any) -> BulletWorld:
        """Refuse a world without servos, or with a learned one already.

        Raises:
            ConfigError: It is one of these.
        """
        if not isinstance(world, BulletWorld):
            raise ConfigError("grounding", "only robots in Bullet worlds have servos to learn; take another grounding")
        check_replayable(world.motors, world.plant)
        if world.servo is not None:
            raise ConfigError("grounding", "the simulator has a learned servo already; say grounding=none")
        return world

    @property
    def actions(self) -> Grounding:
        """What stands between the agent's actions and the changed world."""
        return ActionNoise(self.noise) if self.noise else NoGrounding()
