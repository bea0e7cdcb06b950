"""A folder of one's own: the robot of a URDF with what it leaves open written out, and a world that has it."""

from __future__ import annotations

import os
import re
import shlex
import shutil
from collections.abc import Collection, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any

import yaml

from gsl.core.body import Robot
from gsl.core.setting import component, setting
from gsl.core.validation import make
from gsl.errors import ConfigError, InputError
from gsl.report.console import Console
from gsl.robots.catalogue import names
from gsl.robots.descriptions import PREFIX
from gsl.robots.hinges import JointSettings, drivable, from_description
from gsl.robots.joint_limits import ENDS, is_limit, is_range
from gsl.robots.robot_file import urdf_of
from gsl.robots.urdf_xml import Description, Hinge, read_description
from gsl.storage.whole import explain_refusal

ROBOT, WORLD = "robot.yaml", "world/{}.yaml"

_ROBOT_HEAD = """\
# The robot of {urdf}: the joints that an action names, in this order, and their servos.
# Gains and rotors (armature) are derived from effort and velocity (docs/howto/own-robot.md).
# Write here what you know better.
# A diagnosis fits gains, friction and rotors of every joint anew before it looks for a cause.
"""
_WORLD_TEXT = """\
# {name}, its base fixed. What you know that the simulator lacks is for effects to say (docs/reference/effects.md).
defaults: [urdf, _self_]
robot: {robot}   # as seen from the folder of --config-dir, or else from where you type gsl
period: {period:g}   # [s]: the control period of your logs
effects:{effects}
"""
_DYNAMICS = {"damping": ("viscous_friction", "coefficient"), "friction": ("coulomb_friction", "torque")}
"""What <dynamics> says -> effect and its parameter."""


@component
class Init:
    """What `gsl init` is told; of joints that slide, in m for rad and N for N·m."""

    urdf: Annotated[str, setting("your robot: a file, or robot_descriptions:NAME", min_length=1)]
    name: Annotated[str, setting("what its world will be called", min_length=1)]
    out: Annotated[str | None, setting("folder to write; the name by default", min_length=1)] = None
    joints: Annotated[tuple[str, ...], setting("controlled joints in order; all that move by default")] = field(
        default=()
    )
    effort: Annotated[float | None, setting("peak torque where the URDF says none", unit="N·m", gt=0)] = None
    velocity: Annotated[float | None, setting("speed without load where it says none", unit="rad/s", gt=0)] = None
    lower: Annotated[float | None, setting("least position where it says no range", unit="rad")] = None
    upper: Annotated[float | None, setting("greatest position where it says no range", unit="rad")] = None
    period: Annotated[float, setting("control period of your logs", unit="s", gt=0, le=0.1)] = 0.02


def write_configuration(arguments: Sequence[str], worlds: Collection[str], console: Console) -> None:
    """Write the folder and say what to type next.

    Args:
        arguments: Of the form key=value, the settings of `Init`.
        worlds: Names of the worlds that come with gsl.
        console: Where to say it.

    Raises:
        InputError: A setting is wrong, the URDF cannot be read, or the folder is there already.
    """
    asked: Init = make(Init, _settings(arguments))
    folder, urdf = Path(asked.out or asked.name), urdf_of(asked.urdf)
    if not re.fullmatch(r"[A-Za-z_][\w-]*", asked.name):
        raise ConfigError(
            "name", "must be a word of letters, digits, _ and -, not beginning with a digit", given=asked.name
        )
    if asked.name in {*worlds, *names()}:
        raise ConfigError("name", "is that of a world or a robot that comes with gsl; take another", given=asked.name)
    if folder.exists():
        raise InputError(f"{folder}: exists; choose another folder with out=")
    description = read_description(urdf)
    hinges = {hinge.name: hinge for hinge in description.hinges}
    added = {name: _stand_in(asked, hinges.get(name)) for name in asked.joints or drivable(description.hinges)}
    for key in ("effort", "velocity", *ENDS):
        if getattr(asked, key) is not None and all(getattr(settings, key) is None for settings in added.values()):
            problem = "stands in for what a URDF leaves open, and this one says it of every joint; edit the robot file"
            raise ConfigError(key, problem)
    try:
        robot = from_description(description, added, {}, {})
    except ConfigError as error:
        raise InputError(f"{urdf}: {error}") from error
    joints = {name: {**_servo(robot, name), **_range(added[name])} for name in robot.controlled}
    _write(folder, asked, urdf, robot, joints, _effects(description, robot))
    _tell(folder, asked, robot, console)


def _settings(arguments: Sequence[str]) -> dict[str, Any]:
    settings: dict[str, Any] = {}
    for argument in arguments:
        key, equals, value = argument.partition("=")
        if not equals or not value:
            raise ConfigError(argument, "has no value; write key=value")
        settings[key] = value.strip("[]").split(",") if key == "joints" else value
    return settings


def _stand_in(asked: Init, hinge: Hinge | None) -> JointSettings:
    """Return what was told of a joint and its URDF does not say, or only by a placeholder."""
    if hinge is None:  # whoever makes a robot of it will say so
        return JointSettings()
    limit, slides = hinge.limit, hinge.slides
    missing = {key for key in ("effort", "velocity") if not is_limit(key, limit.get(key, 0.0), slides=slides)}
    missing |= set() if is_range(limit, slides=slides) else {*ENDS}
    return JointSettings(**{key: getattr(asked, key) for key in missing})


def _range(settings: JointSettings) -> dict[str, float]:
    ends = {"lower": settings.lower, "upper": settings.upper}
    return {key: value for key, value in ends.items() if value is not None}


def _effects(description: Description, robot: Robot) -> str:
    """Return the friction that <dynamics> says of controlled joints, as effects of a world."""
    frictions: dict[str, dict[float, list[str]]] = {}
    for hinge in description.hinges:
        for key, value in hinge.dynamics.items():
            if value > 0.0 and hinge.name in robot.controlled:
                frictions.setdefault(key, {}).setdefault(value, []).append(hinge.name)
    shared = {
        _DYNAMICS[key][0]: [{_DYNAMICS[key][1]: value, "joints": joints} for value, joints in values.items()]
        for key, values in frictions.items()
    }
    lines = [f"  {effect}: {_flow(entries)}" for effect, entries in shared.items()]
    return "\n".join(["   # of <dynamics>", *lines]) if lines else " {}"


def _write(
    folder: Path, asked: Init, urdf: Path, robot: Robot, joints: Mapping[str, Mapping[str, float]], effects: str
) -> None:
    """Write the folder whole or not at all."""
    place = folder.with_name(f".{folder.name}.tmp-{os.getpid()}")
    world = place / WORLD.format(asked.name)
    with explain_refusal(folder):
        try:
            world.parent.mkdir(parents=True)
            seen = asked.urdf if asked.urdf.startswith(PREFIX) else Path(os.path.relpath(urdf, folder)).as_posix()
            text = _robot_text(robot, urdf.name, seen, joints)
            (place / ROBOT).write_text(text, encoding="utf-8")
            about = {"name": asked.name, "robot": ROBOT, "period": asked.period}
            about["effects"] = effects
            world.write_text(_WORLD_TEXT.format(**about), encoding="utf-8")
            os.rename(place, folder)
        finally:
            shutil.rmtree(place, ignore_errors=True)


def _robot_text(robot: Robot, name: str, urdf: str, values: Mapping[str, Mapping[str, float]]) -> str:
    joints = "".join(f"  {_plain(name)}: {_flow(values[name])}\n" for name in robot.controlled)
    held = "".join(f"# {remark}\n" for remark in robot.remarks)
    units = "  # kp [N·m/rad], kd [N·m·s/rad], effort [N·m], velocity without load [rad/s], armature [kg·m²]\n"
    units += "  # of those that slide: m for rad, N for N·m, kg for kg·m²\n" if robot.slides else ""
    return (
        _ROBOT_HEAD.format(urdf=name)
        + held
        + f"urdf: {_plain(urdf)}   # as seen from this file\njoints:\n{units}{joints}"
        + "held: {}   # where the other joints stand [rad], [m]: 0 or as near as they go if nothing is said\n"
        + "groups: {}   # names for several joints, scopes of effects: {wrist: [roll, pitch]}\n"
        + "ranges: {}   # where effects may be larger on your robot: {backlash: {width: [0, 0.05]}}\n"
    )


def _servo(robot: Robot, name: str) -> dict[str, float]:
    joint, (kp, kd) = robot.joint(name), robot.gains[name]
    numbers = {"kp": kp, "kd": kd, "effort": joint.effort, "velocity": joint.max_velocity, "armature": joint.armature}
    return {key: float(f"{value:.4g}") for key, value in numbers.items()}


def _flow(values: Any) -> str:
    return yaml.safe_dump(values, default_flow_style=True, sort_keys=False, width=1000).strip()


def _plain(text: str) -> str:
    return yaml.safe_dump(text, allow_unicode=True, width=1000).splitlines()[0]


def _tell(folder: Path, asked: Init, robot: Robot, console: Console) -> None:
    name = asked.name
    files = [(folder / part).as_posix() for part in (ROBOT, WORLD.format(name))]
    mine = shlex.quote(folder.as_posix())
    following = [
        f"gsl robot {shlex.quote(files[0])}   # a picture",
        f"gsl collect --config-dir {mine} world={name} task=excite name={name}_sim   # safe motions",
        f"gsl diagnose --config-dir {mine} sim={name} real=LOG name={name}   # a log of the real one",
    ]
    joints = f"{robot.name}: {len(robot.controlled)} controlled joints, {', '.join(robot.controlled)}"
    period = f"its control period is {asked.period:g} s; if your logs have another, write it into the world's file"
    lines = [joints, *(f"remark: {remark}" for remark in robot.remarks), *files, period, "", "what to type next:"]
    document = {"files": files, "joints": list(robot.controlled), "remarks": list(robot.remarks), "next": following}
    console.result(document, text="\n".join([*lines, *(f"  {line}" for line in following)]))
