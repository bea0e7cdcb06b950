"""Observations and recorded columns are the same numbers: where a history window finds its body sensors in either."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from gsl.core.history import tilt
from gsl.core.layout import Layout
from gsl.core.trajectory import Trajectory

SOURCES: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "gyro": ("gyro", ("gyro.x", "gyro.y", "gyro.z")),
    "tilt": ("base.orientation", tuple(f"base.orientation.{axis}" for axis in "xyzw")),
    "foot_force": ("foot_force", ("foot_force.left", "foot_force.right")),
}
"""For each body sensor of a window the part of an observation and the trajectory columns it is computed from."""


def observations(episode: Trajectory, layout: Layout) -> np.ndarray:
    """Return what a world would have observed, shape (T + 1, layout.size).

    Raises:
        KeyError: with the name of a column that was not recorded.
    """
    states = np.empty((len(episode) + 1, layout.size))
    states[:, layout["position"]], states[:, layout["velocity"]] = episode.position, episode.velocity
    for part, columns in layout.columns.items():
        states[:, layout[part]] = np.column_stack([episode.sensors[name] for name in columns])
    return states


def missing(episode: Trajectory, layout: Layout) -> list[str]:
    """Return the parts of an observation that an episode does not tell, without which no simulation starts from it."""
    return [part for part, columns in layout.columns.items() if not episode.sensors.keys() >= set(columns)]


def read_sensors(episode: Trajectory, sensors: Iterable[str]) -> np.ndarray:
    """Return the body sensors that a window names, shape (T + 1, number of entries); see `observations`."""
    columns = [
        column for name in sensors for column in _sensor(name, [episode.sensors[source] for source in SOURCES[name][1]])
    ]
    return np.column_stack(columns) if columns else np.zeros((len(episode) + 1, 0))


class Senses:
    """Picks joint positions and the body sensors of a window out of an observation."""

    def __init__(self, layout: Layout, sensors: Iterable[str]) -> None:
        self._position = layout["position"]
        self._parts = [(name, layout[SOURCES[name][0]]) for name in sensors]

    def position(self, observation: np.ndarray) -> np.ndarray:
        """Return the joint positions [rad], shape (n_joints,)."""
        return observation[self._position]

    def read(self, observation: np.ndarray) -> list[float]:
        """Return the body sensors, in order."""
        return [entry for name, part in self._parts for entry in _sensor(name, observation[part].tolist())]


def _sensor(name: str, columns: Sequence[Any]) -> Sequence[Any]:
    return tilt(*columns) if name == "tilt" else columns
