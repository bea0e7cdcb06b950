"""The contract of trajectory files: which columns there are, in which units, and what their rows must obey."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.budget import COLUMNS, find_repeat
from gsl.core.likeness import find_alike
from gsl.errors import TrajectoryError, shorten

SCHEMA_VERSION = 1
ROLES = ("real", "sim", "imported")
REQUIRED_KEYS = ("robot", "joints", "control_period", "role", "units")
UNITS: Mapping[str, str] = {
    "time": "s",
    "action": "rad",
    "grounded_action": "rad",
    "position": "rad",
    "velocity": "rad/s",
    "torque": "N·m",
    "velocity_command": "rad/s",
    "torque_command": "N·m",
    "kp_command": "N·m/rad",
    "kd_command": "N·m·s/rad",
    "voltage": "V",
    "temperature": "°C",
    "gyro": "rad/s",
    "acceleration": "m/s²",
    "foot_force": "N",
    "base.position": "m",
    "base.orientation": "1",
    "base.velocity": "m/s",
}
INTEGERS = ("episode", "step")
BOOLEANS = ("enabled", "fell", "terminated")
BLANK_AT_THE_END = ("action", "grounded_action", "reward", "next_state")
JOINT_SENSORS = ("torque", "temperature", "velocity_command", "torque_command", "kp_command", "kd_command")
SENSORS = (
    *("voltage", "enabled", "foot_force.left", "foot_force.right"),
    *(f"{group}.{axis}" for group in ("gyro", "acceleration", "base.position", "base.velocity") for axis in "xyz"),
    *(f"base.orientation.{axis}" for axis in "xyzw"),
)


MOST_EPISODES = 100_000
SHORTEST = 1e-6
"""Period of a log [s]; no robot is read a million times a second, and the rate of a shorter one may be no number."""
LARGEST = 1e12  # of any number in a column, in SI units: squares and sums of such numbers are still numbers
SHOWN = 40  # characters of a value in an error
MOST_PERIOD = 1e6  # of a control period [s], days
MOST_TRANSITIONS = 100_000_000  # from cell to cell by a choice, which a table of counts takes in memory


def _is_number(value: Any, most: float) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= most


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and _is_number(value, COLUMNS) and value >= 0


def _is_label(value: Any) -> bool:
    if not isinstance(value, dict):
        return False
    return isinstance(value.get("policy"), str | None) and isinstance(value.get("conditions"), dict | None)


_KINDS: Mapping[str, tuple[Callable[[Any], bool], str]] = {
    "robot": (lambda value: isinstance(value, str), "a name"),
    "episodes": (
        lambda value: isinstance(value, list) and all(map(_is_label, value)),
        "a list of mappings, one an episode, with a name as `policy` and effects as `conditions`",
    ),
    "slides": (
        lambda value: isinstance(value, list) and all(isinstance(name, str) for name in value),
        "a list of joints",
    ),
    "action_noise": (lambda value: _is_number(value, 1e6), "a number"),
    "pi0_falls": (lambda value: _is_number(value, 1.0), "a share"),
    **dict.fromkeys(("cells", "choices"), (_is_count, "a number of them")),
}
"""What further entries of the metadata have to be, where they are there."""


def joint_columns(group: str, joints: Iterable[str]) -> list[str]:
    """Return the columns of `group`, one a joint, in the joints' order."""
    return [f"{group}.{joint}" for joint in joints]


def state_columns(group: str, states: int) -> list[str]:
    """Return the columns of `group`, one for each entry of a state that is not joints."""
    return [f"{group}.{index}" for index in range(states)]


def list_required(joints: Iterable[str], states: int = 0) -> list[str]:
    """Return the columns without which there is no trajectory; `states` is 0 where the state is joints."""
    groups = ("action",) if states else ("action", "position", "velocity")
    named = [name for group in groups for name in joint_columns(group, joints)]
    return [*INTEGERS, "time", *named, *state_columns("state", states), *state_columns("next_state", states)]


def blank_at_the_end(name: str) -> bool:
    """Tell whether a column says what was done in a step, so that the last row of an episode has no value."""
    return name.partition(".")[0] in BLANK_AT_THE_END


def check_metadata(path: Path, metadata: Any, robot_joints: tuple[str, ...] | None) -> None:
    """Refuse metadata of another version, incomplete, or of a robot with other joints than `robot_joints`."""
    if not isinstance(metadata, Mapping) or "schema_version" not in metadata:
        raise TrajectoryError(path, "the metadata key `gsl` holds no schema_version; write the file with gsl")
    if metadata["schema_version"] != SCHEMA_VERSION:
        version = metadata["schema_version"]
        raise TrajectoryError(path, f"schema_version {version!r} is unknown; this gsl reads {SCHEMA_VERSION}")
    if missing := [key for key in REQUIRED_KEYS if metadata.get(key) is None]:
        raise TrajectoryError(path, f"the metadata lack {', '.join(missing)}; add them under the key `gsl`")
    if metadata["role"] not in ROLES:
        raise TrajectoryError(path, f"role {metadata['role']!r} is none of {', '.join(ROLES)}")
    period = metadata["control_period"]
    if not (_is_number(period, MOST_PERIOD) and period > 0):
        raise TrajectoryError(path, f"control_period {_short(period)} must be a positive number of seconds")
    if period < SHORTEST:
        raise TrajectoryError(path, f"control_period {_short(period)} must be at least {SHORTEST:g} s")
    states = metadata.get("states", 0)
    if not _is_count(states):
        raise TrajectoryError(path, f"states {_short(states)} must be the number of entries of the state")
    for key, (fits, what) in _KINDS.items():
        if metadata.get(key) is not None and not fits(metadata[key]):
            raise TrajectoryError(path, f"{key} {_short(metadata[key])} must be {what} in the metadata")
    if (metadata.get("cells") or 0) ** 2 * (metadata.get("choices") or 0) > MOST_TRANSITIONS:
        raise TrajectoryError(
            path, f"cells and choices make more than {MOST_TRANSITIONS:,} transitions in the metadata"
        )
    _check_joints(path, metadata, None if states else robot_joints)
    _check_units(path, metadata["units"])


def _check_joints(path: Path, metadata: Mapping[str, Any], robot_joints: tuple[str, ...] | None) -> None:
    joints = metadata["joints"]
    named = isinstance(joints, (list, tuple)) and joints and all(isinstance(joint, str) and joint for joint in joints)
    if not named or len(set(joints)) != len(joints):
        raise TrajectoryError(path, "joints must be a list of different names in the metadata")
    for joint in joints:
        if robot_joints is not None and joint not in robot_joints:
            advice = f"{suggestion(joint, robot_joints)}; this file is of {metadata['robot']}"
            raise TrajectoryError(path, f"the robot has no such joint{advice}", column=f"position.{joint}")


def _check_units(path: Path, units: Any) -> None:
    if not isinstance(units, Mapping):
        raise TrajectoryError(path, "units must map groups of columns to units in the metadata")
    for group, unit in units.items():
        if group in UNITS and _spell(str(unit)) != _spell(UNITS[group]):
            raise TrajectoryError(path, f"the unit is {unit}, not {UNITS[group]}; convert the column", column=group)


def _spell(unit: str) -> str:
    return unit.replace("·", "").replace("*", "").replace(" ", "").replace("^2", "²")


def check_names(path: Path, names: list[str], metadata: Mapping[str, Any]) -> None:
    """Refuse missing, duplicated and unknown columns; a column named in `units` beside the contract's is known."""
    joints, units, states = metadata["joints"], metadata["units"], metadata.get("states", 0)
    if (name := find_repeat(names)) is not None:
        raise TrajectoryError(path, f"there are {names.count(name)} columns of this name; keep one", column=name)
    required = list_required(joints, states)
    if any(name.startswith("grounded_action.") for name in names):
        required += joint_columns("grounded_action", joints)
    there, own = set(names), set(units) - set(UNITS)
    for name in required:
        if name not in there:
            raise TrajectoryError(path, f"is missing{suggestion(name, there - set(required))}", column=name)
    columns = {*required, "reward"}
    if states:
        columns.add("terminated")
    else:
        columns.update((*SENSORS, "fell", *(name for group in JOINT_SENSORS for name in joint_columns(group, joints))))
    for name in names:
        declared = (name in own or name.rpartition(".")[0] in own) and not name.startswith("next_state.")
        if name not in columns and not declared:
            advice = f"is unknown{suggestion(name, columns)}; a column of your own needs a unit under `units`"
            raise TrajectoryError(path, advice, column=name)


def check_rows(path: Path, columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Refuse rows out of order, time that stands still and values missing or out of place.

    Returns:
        Row at which each episode begins, and the number of rows at the end, shape (n_episodes + 1,).
    """
    episode, step = (columns[name].astype(np.int64) for name in INTEGERS)
    if not len(episode):
        raise TrajectoryError(path, "has no rows; collect it again")
    within = np.diff(episode) == 0
    _refuse(path, "episode", np.diff(episode) < 0, "falls; sort the rows by (episode, step)", first=1)
    problem = "must rise by one within an episode; sort the rows and split the episode where rows are missing"
    _refuse(path, "step", within & (np.diff(step) != 1), problem, first=1)
    last = np.append(~within, True)
    _refuse(path, "episode", last & np.insert(last[:-1], 0, True), "has one row only; drop the episode")
    problem = "does not rise within the episode; drop or mend the row"
    _refuse(path, "time", ~np.isfinite(columns["time"]), "is not a finite number; drop or mend the row")
    _refuse(path, "time", within & (np.diff(columns["time"]) <= 0), problem, first=1)
    for name, values in columns.items():
        _check_values(path, name, values, last)
        if name.startswith("next_state."):
            after = np.append(columns[name.removeprefix("next_")][1:], np.nan)
            _refuse(path, name, ~last & (values != after), "is not the state of the next row; split the episode there")
    if (count := int(last.sum())) > MOST_EPISODES:
        raise TrajectoryError(path, f"has {count:,} episodes; {MOST_EPISODES:,} are read", column="episode")
    return np.insert(np.flatnonzero(last) + 1, 0, 0)


def _check_values(path: Path, name: str, values: np.ndarray, last: np.ndarray) -> None:
    if values.dtype.kind != "f":
        return
    inside = ~last if blank_at_the_end(name) else slice(None)
    _refuse(
        path, name, np.abs(values) > LARGEST, f"is beyond {LARGEST:g}, which nothing measures; drop or mend the row"
    )
    if np.isfinite(values[inside]).all() and (isinstance(inside, slice) or np.isnan(values[last]).all()):
        return
    if isinstance(inside, slice):
        _refuse(path, name, ~np.isfinite(values), "is not a finite number; drop or mend the row")
    _refuse(path, name, ~last & ~np.isfinite(values), "only the last row of an episode may be empty; mend the row")
    problem = "must be empty (NaN) in the last row of an episode; add the row of the last state"
    _refuse(path, name, last & ~np.isnan(values), problem)


def _refuse(path: Path, column: str, wrong: np.ndarray, problem: str, *, first: int = 0) -> None:
    if wrong.any():
        raise TrajectoryError(path, problem, column=column, row=int(np.argmax(wrong)) + first)


def suggestion(name: str, choices: Iterable[str]) -> str:
    """Return `, did you mean ...?` when one of `choices` resembles `name`, else nothing."""
    close = find_alike(name, sorted(choices), cutoff=0.75)
    return f", did you mean {shorten(close[0])}?" if close else ""


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}..."
