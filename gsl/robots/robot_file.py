"""A robot from a user's file: a URDF as it is, or a yaml that says what a URDF leaves open, or of servos alone.

    urdf: arm.urdf                # beside this file; without it every joint is a servo of its own with an unknown load
    joints:                       # those that an action names, in this order; the others are held
      shoulder: {kp: 40, kd: 1.2, armature: 0.005, effort: 3.0, velocity: 6.0}
      elbow: {}                   # what is left out comes from the URDF, or from defaults.py

docs/howto/own-robot.md tells all of it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from gsl.core.body import Robot
from gsl.core.budget import read_text
from gsl.core.setting import component, setting
from gsl.core.trust import ROBOT_FILES
from gsl.core.validation import did_you_mean, make
from gsl.core.yaml_tree import yaml_tree
from gsl.effects.effect import check_ranges
from gsl.errors import ConfigError, InputError
from gsl.robots.descriptions import PREFIX, find_description
from gsl.robots.hinges import JointSettings, from_description, lone
from gsl.robots.urdf_xml import read_description

YAML = (".yaml", ".yml")
SUFFIXES = ROBOT_FILES


@component
class RobotSettings:
    """What a robot's yaml file may say."""

    urdf: Annotated[
        str | None, setting("the body: a file beside this one, or robot_descriptions:NAME; none for lone servos")
    ] = None
    hulls: Annotated[bool, setting("whether the URDF's <collision> meshes collide, as convex hulls")] = False
    name: Annotated[str | None, setting("of the robot; that of the URDF by default", min_length=1)] = None
    joints: Annotated[Mapping[str, Any] | None, setting("controlled joints in order, with what is known of them")] = (
        None
    )
    held: Annotated[Mapping[str, float], setting("where the other joints are held [rad], [m]")] = field(
        default_factory=dict
    )
    groups: Annotated[Mapping[str, tuple[str, ...]], setting("names for sets of joints")] = field(default_factory=dict)
    stance: Annotated[Mapping[str, float], setting("a usual posture, others at 0 [rad], [m]")] = field(
        default_factory=dict
    )
    encoder_step: Annotated[float, setting("resolution of the encoders", unit="rad", ge=0)] = 2.0 * math.pi / 4096
    encoder_side: Annotated[Literal["output", "motor"], setting("side of the gear that the encoder sees")] = "output"
    supply_voltage: Annotated[float, setting("without load", unit="V", gt=0)] = 12.0
    no_load_speed: Annotated[float, setting("factor on the joints' velocity", gt=0)] = 1.0
    ranges: Annotated[
        Mapping[str, Mapping[str, tuple[float, float]]], setting("ranges of effects' parameters for this robot")
    ] = field(default_factory=dict)


def urdf_of(name: str, folder: Path = Path()) -> Path:
    """Return a URDF: a file, as seen from a folder, or one of robot_descriptions.

    Raises:
        InputError: There is none of that name in robot_descriptions.
    """
    return find_description(name) if name.startswith(PREFIX) else folder / name


def files_of(path: Path) -> tuple[Path, ...]:
    """Return the files that a robot is read from: the file itself, the URDF that it names, and meshes that collide."""
    settings = _settings(path) if path.suffix in YAML else RobotSettings()
    if settings.urdf is None:
        return (path,)
    urdf = urdf_of(settings.urdf, path.parent)
    return (path, urdf, *(read_description(urdf, hulls=True).hulls if settings.hulls else ()))


def from_file(path: Path) -> Robot:
    """Read a robot.

    Raises:
        InputError: A file cannot be read, or what it says cannot be a robot.
    """
    settings = _settings(path) if path.suffix in YAML else RobotSettings(urdf=path.name)
    try:
        joints = None if settings.joints is None else _joints(settings.joints)
        if settings.urdf is not None:
            urdf = urdf_of(settings.urdf, path.parent)
            if not urdf.exists():
                raise ConfigError("urdf", "there is no such file, as seen from the robot's file", given=settings.urdf)
            description = read_description(urdf, hulls=settings.hulls)
            robot = from_description(description, joints, settings.held, settings.stance)
        else:
            robot = lone(settings.name or path.stem, joints or {})
        return _complete(robot, settings)
    except ConfigError as error:
        raise InputError(f"{path}: {error}") from error


def _complete(robot: Robot, settings: RobotSettings) -> Robot:
    for group, members in settings.groups.items():
        for name in members:
            _check_motor(robot, name, f"groups.{group}")
    for name in settings.stance:
        _check_motor(robot, name, "stance")
    for effect, ranges in settings.ranges.items():
        check_ranges(effect, ranges)
    return replace(
        robot,
        name=re.sub(r"[^\w-]+", "_", settings.name or robot.name),
        groups=dict(settings.groups),
        stance=dict(settings.stance),
        encoder_step=settings.encoder_step,
        encoder_side=settings.encoder_side,
        supply_voltage=settings.supply_voltage,
        no_load_speed=settings.no_load_speed,
        ranges={**robot.ranges, **settings.ranges},
    )


def _check_motor(robot: Robot, name: str, where: str) -> None:
    if name not in robot.motors:
        raise ConfigError(where, f"'{name}' is no controlled joint{did_you_mean(name, robot.motors, listed=True)}")


def _settings(path: Path) -> RobotSettings:
    entries = yaml_tree(path, read_text(path))
    if not isinstance(entries, Mapping):
        raise InputError(f"{path}: says nothing of a robot; see docs/howto/own-robot.md")
    try:
        return make(RobotSettings, entries)
    except ConfigError as error:
        raise InputError(f"{path}: {error}") from error


def _joints(entries: Mapping[str, Any]) -> dict[str, JointSettings]:
    for name, entry in entries.items():
        if not isinstance(entry or {}, Mapping):
            raise ConfigError(f"joints.{name}", "must map its settings to values", given=str(entry))
    return {str(name): make(JointSettings, entry or {}, where=f"joints.{name}") for name, entry in entries.items()}
