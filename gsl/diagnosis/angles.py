"""A diagnosis of joints that slide: it works in angles (`core.slides`), and reads and answers in metres and newtons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gsl.core.body import Robot
from gsl.core.plant import Plant
from gsl.core.setting import settings_of
from gsl.core.slides import in_angles, levers, power, unit_of_slide
from gsl.core.trajectory import Batch, Trajectory
from gsl.effects.effect import effect_class
from gsl.storage.trajectory_contract import UNITS


def with_log_in_angles(batch: Batch, plant: Plant) -> tuple[Batch, Plant]:
    """Return a log in the units of its plant, and that, with slides in angles; both as they are where these are."""
    angular = in_angles(plant)
    if angular is plant:
        return batch, plant
    way = dict(zip(angular.robot.motors, levers(angular.robot).tolist(), strict=True))
    columns = np.array([way.get(joint, 1.0) for joint in batch.joints])
    labels = [
        {**label, "conditions": _effects_in_units(label["conditions"], angular.robot, way)}
        if label.get("conditions")
        else label
        for label in batch.metadata.get("episodes") or []
    ]
    episodes = tuple(_in_units(episode, columns, way) for episode in batch.episodes)
    return replace(batch, episodes=episodes, metadata={**batch.metadata, "episodes": labels}), angular


def _in_units(episode: Trajectory, columns: np.ndarray, way: Mapping[str, float]) -> Trajectory:
    sent = episode.grounded_action
    return replace(
        episode,
        action=episode.action / columns,
        position=episode.position / columns,
        velocity=episode.velocity / columns,
        grounded_action=None if sent is None else sent / columns,
        sensors={name: values * _factor(name, way) for name, values in episode.sensors.items()},
    )


def _factor(column: str, way: Mapping[str, float]) -> float:
    group, _, joint = column.rpartition(".")
    return way.get(joint, 1.0) ** power(UNITS.get(group, ""))


def effects_in_metres(effects: Mapping[str, Any], robot: Robot) -> dict[str, Any]:
    """Return effects that were found in angles as a world takes them: joints of another lever get entries of their own.

    Args:
        effects: A world's `effects:` mapping, for the robot in angles.
        robot: In angles.
    """
    if not robot.slides:
        return {**effects}
    return _effects_in_units(effects, robot, dict(zip(robot.motors, (1.0 / levers(robot)).tolist(), strict=True)))


def _effects_in_units(effects: Mapping[str, Any], robot: Robot, ratio: Mapping[str, float]) -> dict[str, Any]:
    """Return effects in units of position that are so many times as long, by motor."""
    return {name: _entries(name, entries, robot, ratio) for name, entries in effects.items()}


def _entries(name: str, entries: Any, robot: Robot, ratio: Mapping[str, float]) -> list[Any]:
    """Return the entries of one effect; those whose numbers have no unit of a joint stay as they are."""
    result = []
    for entry in entries if isinstance(entries, list | tuple) else [entries]:
        settings = settings_of(effect_class(name))
        powers = {key: exponent for key in entry if key in settings and (exponent := power(settings[key].unit))}
        joints = robot.list_joints(entry.get("joints", "all")) if "joints" in settings and powers else []
        shares = sorted({ratio[joint] for joint in joints}, reverse=True)
        if shares in ([], [1.0]):
            result.append(entry)
            continue
        for share in shares:
            own = [joint for joint in joints if ratio[joint] == share]
            scope = entry.get("joints", "all") if len(shares) == 1 else own[0] if len(own) == 1 else own
            scaled = {key: entry[key] * share**exponent for key, exponent in powers.items()}
            result.append({**entry, **scaled, "joints": scope})
    return result


def say(robot: Robot, joints: Sequence[str], unit: str) -> tuple[float, str]:
    """Return the factor that takes a number of some joints from angles to what a reader is told, and its unit there.

    Args:
        robot: In angles.
        joints: Whose number it is.
        unit: Of the number in angles.
    """
    ways, exponent = {robot.joint(joint).lever for joint in joints}, power(unit)
    if not exponent or ways <= {1.0}:
        return 1.0, unit
    if len(ways) == 1:
        return float(ways.pop() ** -exponent), unit_of_slide(unit)
    shares = sorted(float(way**-exponent) for way in ways - {1.0})
    share = " to ".join(dict.fromkeys(f"{share:.3g}" for share in (shares[0], shares[-1])))
    return 1.0, f"{unit} (1 {unit} stands for {share} {unit_of_slide(unit)} of a slide)"


def write_angle(robot: Robot, joint: str, angle: float, form: str = "+.0f") -> str:
    """Return an angle of a joint in mrad, of a slide in mm."""
    factor, unit = say(robot, (joint,), "rad")
    return f"{1e3 * factor * angle:{form}} m{unit}"
