"""A real robot somewhere else: its episodes come from files, so that asking it for one is to write down a request."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import gymnasium
import numpy as np

from gsl.core.body import Robot
from gsl.core.interfaces import World
from gsl.core.layout import Layout
from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.policies.limits import SPEED_SHARE, WINDOW, limits, narrowest
from gsl.robots.catalogue import read_files, robot
from gsl.worlds.fits import check_base

_SIZES = {"gyro": 3, "base.position": 3, "base.orientation": 4, "base.velocity": 3}
Sensor = Literal["gyro", "foot_force", "base.position", "base.orientation", "base.velocity"]


@component
class ExternalRobot:
    """A robot that gsl cannot reach; what is to be run on it goes out as files, what it did comes back as files."""

    robot: Annotated[str, setting("name of the robot, or package.module.function of one's own")]
    period: Annotated[float, setting("control period", unit="s", gt=0, le=0.1)] = 0.02
    floating: Annotated[bool, setting("base on the ground (true) or held in the air (false)")] = True
    sensors: Annotated[tuple[Sensor, ...], setting("what it tells beside its joints; more may come in its logs")] = (
        "gyro",
        "foot_force",
    )
    speed: Annotated[float, setting("share of the joints' speed limits that a target may use", gt=0, le=3)] = 1.0
    ramp: Annotated[float, setting("least duration of a ramp in or out", unit="s", ge=1, le=60)] = 3.0
    ramp_speed: Annotated[float, setting("of the fastest joint in a ramp", unit="rad/s", gt=0, le=2)] = 0.5
    within: Annotated[
        float, setting("of the start that each joint must be after the ramp in", unit="rad", gt=0, le=1)
    ] = 0.2
    requests: Annotated[str | None, setting("folder of the requests and their answers", min_length=1)] = None

    def __post_init__(self) -> None:
        """Refuse a robot that does not exist or cannot stand where it should, and a sensor named twice."""
        check_base(self.body, floating=self.floating)
        if len(set(self.sensors)) != len(self.sensors):
            raise ConfigError("sensors", "names one twice", given=", ".join(self.sensors))

    @property
    def read_files(self) -> Mapping[str, Path]:
        """What it is read from, by the setting that names it."""
        return read_files(self.robot)

    @cached_property
    def body(self) -> Robot:
        """The robot's constants."""
        return robot(self.robot)

    @property
    def layout(self) -> Layout:
        """What an observation holds."""
        joints, widths = self.body.controlled, {**_SIZES, "foot_force": len(self.body.feet)}
        sensors: dict[str, int] = {name: widths[name] for name in self.sensors if widths[name]}
        return Layout(joints, {"position": len(joints), "velocity": len(joints), **sensors}, self.period)

    @property
    def limits(self) -> dict[str, Any]:
        """What a target may be: lists in the order of the joints, `lower`, `upper`, `step`, `path` [rad], `torque`.

        `step` is the most of a change in one tick: at the speed limit, or a jump that an excitation may make; `path` is
        the most of a way within `window` [s].
        """
        bounds, motors = limits(self.body), [self.body.joint(name) for name in self.body.motors]
        fastest = self.speed * bounds.speed / SPEED_SHARE
        effort = narrowest(self.body, [joint.effort for joint in motors])
        step = np.maximum(fastest * self.period, self.speed * bounds.jump)
        each = {"lower": bounds.lower, "upper": bounds.upper, "step": step, "path": fastest * WINDOW}
        table: dict[str, Any] = {name: values.tolist() for name, values in {**each, "speed": fastest}.items()}
        return {**table, "torque": effort.tolist(), "window": WINDOW}

    def make(self) -> gymnasium.Env:
        """Refuse: there is nothing here that could be simulated.

        Raises:
            ConfigError: Always.
        """
        problem = "a real robot somewhere else cannot be simulated; it serves as real= of iterate, collect and evaluate"
        raise ConfigError("world", problem)


def asking(world: World, artifact: Path) -> World:
    """Return a world whose requests, if it makes any, lie beside an artifact."""
    return replace(world, requests=f"{artifact.as_posix()}.request") if isinstance(world, ExternalRobot) else world
