"""A batch as the columns of a table, and back."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.trajectory import Batch, Trajectory
from gsl.errors import TrajectoryError
from gsl.storage.trajectory_contract import (
    BOOLEANS,
    INTEGERS,
    SCHEMA_VERSION,
    UNITS,
    blank_at_the_end,
    joint_columns,
    state_columns,
)

ARRAYS = ("action", "grounded_action", "position", "velocity")
OF_ACTIONS = ("action", "grounded_action")
OWN_FIELDS = ("schema_version", "joints", "states", "control_period")


def columns_of(path: Path, batch: Batch) -> dict[str, np.ndarray]:
    """Return the columns of `batch` by name; the last row of an episode holds NaN for what was done in it.

    Raises:
        TrajectoryError: An array has another length or number of joints, or episodes have different columns.
    """
    parts = [_episode_columns(path, batch, index, episode) for index, episode in enumerate(batch.episodes)]
    for index, part in enumerate(parts):
        if part.keys() != parts[0].keys():
            different = sorted(part.keys() ^ parts[0].keys())
            raise TrajectoryError(path, f"episode {index} and episode 0 differ in it", column=different[0])
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _episode_columns(path: Path, batch: Batch, index: int, episode: Trajectory) -> dict[str, np.ndarray]:
    rows = len(episode) + 1
    columns: dict[str, np.ndarray] = {
        "episode": np.full(rows, index, dtype=np.int32),
        "step": np.arange(rows, dtype=np.int32),
        "time": episode.time,
    }
    for group in OF_ACTIONS if batch.states else ARRAYS:
        if (values := getattr(episode, group)) is not None:
            if np.ndim(values) != 2 or values.shape[1] != len(batch.joints):
                problem = f"episode {index}: shape {np.shape(values)} for {len(batch.joints)} joints"
                raise TrajectoryError(path, problem, column=group)
            columns.update(zip(joint_columns(group, batch.joints), np.asarray(values).T, strict=True))
    if episode.state is not None:
        now, then = episode.state.T, episode.state[1:].T
        columns.update(zip(state_columns("state", batch.states), now, strict=True))
        columns.update(zip(state_columns("next_state", batch.states), then, strict=True))
    columns.update({name: episode.sensors[name] for name in sorted(episode.sensors)})
    columns.update({name: getattr(episode, name) for name in ("reward", "fell") if getattr(episode, name) is not None})
    return {name: _column(path, index, name, values, rows) for name, values in columns.items()}


def _column(path: Path, index: int, name: str, values: np.ndarray, rows: int) -> np.ndarray:
    blank = blank_at_the_end(name)
    if np.shape(values) != (rows - blank,):
        problem = f"episode {index}: {np.shape(values)} values, but {rows - blank} are due"
        raise TrajectoryError(path, problem, column=name)
    if name in INTEGERS:
        return np.asarray(values)
    values = np.asarray(values, dtype=bool if name in BOOLEANS else np.float64)
    return np.append(values, np.nan) if blank else values


def metadata_of(batch: Batch, columns: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Return what the file says of itself: the batch's metadata, joints, control period [s] and units."""
    groups = {*columns, *(name.partition(".")[0] for name in columns), *(name.rpartition(".")[0] for name in columns)}
    usual = {"time": UNITS["time"]} if batch.states else UNITS
    units = {**batch.metadata.get("units", {}), **{group: unit for group, unit in usual.items() if group in groups}}
    return {
        **dict.fromkeys(("source", "seed", "world", "policy")),
        **batch.metadata,
        "units": units,
        "schema_version": SCHEMA_VERSION,
        "joints": list(batch.joints),
        **({"states": batch.states} if batch.states else {}),
        "control_period": batch.control_period,
    }


def batch_of(columns: Mapping[str, np.ndarray], metadata: Mapping[str, Any], bounds: np.ndarray) -> Batch:
    """Return the batch that checked columns hold.

    Args:
        columns: All columns by name, each of shape (n_rows,).
        metadata: What the file says of itself.
        bounds: Row at which each episode begins, and the number of rows, shape (n_episodes + 1,).
    """
    joints, states = tuple(metadata["joints"]), metadata.get("states", 0)
    arrays = _arrays(columns, joints, states)
    own = {*INTEGERS, *arrays, *(name for group in ARRAYS for name in joint_columns(group, joints))}
    own.update((*state_columns("state", states), *state_columns("next_state", states)))
    sensors = {name: values for name, values in columns.items() if name not in own}
    episodes = tuple(
        Trajectory(
            **{name: values[start : end - blank_at_the_end(name)] for name, values in arrays.items()},
            sensors={name: values[start:end] for name, values in sensors.items()},
        )
        for start, end in itertools.pairwise(bounds)
    )
    rest = {key: value for key, value in metadata.items() if key not in OWN_FIELDS}
    return Batch(episodes, joints, float(metadata["control_period"]), rest)


def _arrays(columns: Mapping[str, np.ndarray], joints: tuple[str, ...], states: int) -> dict[str, np.ndarray]:
    groups: dict[str, np.ndarray] = {
        group: np.column_stack([columns[name] for name in joint_columns(group, joints)])
        for group in ARRAYS
        if joint_columns(group, joints)[0] in columns
    }
    if states:
        nothing = np.zeros((len(columns["time"]), 0))
        groups |= {"position": nothing, "velocity": nothing}
        groups["state"] = np.column_stack([columns[name] for name in state_columns("state", states)])
    return {**groups, **{name: columns[name] for name in ("time", "reward", "fell") if name in columns}}
