"""The signals that a network may see: what each is computed from, how many numbers it has, and what they mean."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from gsl.core.layout import Layout

Signal = Literal[
    "position", "velocity", "last_action", "gyro", "gravity", "body_velocity", "foot_force",
    "base.position", "base.orientation", "base.velocity", "state", "constant", "phase",
]  # fmt: skip
OF_JOINTS = ("position", "velocity")
AXES = ("x", "y", "z")
UNITS: Mapping[str, str] = {
    "position": "rad", "velocity": "rad/s", "gyro": "rad/s", "body_velocity": "m/s", "foot_force": "N",
    "base.position": "m", "base.velocity": "m/s",
}  # fmt: skip


@dataclass
class Episode:
    """What a network has to know beside an observation.

    Attributes:
        time: Since the episode began [s].
        last_action: What the network answered last, zero at first, shape (n_outputs,).
    """

    time: float
    last_action: np.ndarray


class Source(NamedTuple):
    """A signal in one world.

    Attributes:
        names: Of its numbers, in order.
        read: From an observation, shape (layout.size,), and the episode to the numbers.
    """

    names: tuple[str, ...]
    read: Callable[[np.ndarray, Episode], np.ndarray]


def find_part(signal: str) -> str:
    """Return the part of an observation that a signal is computed from; nothing if it needs none."""
    if signal in ("last_action", "constant", "phase"):
        return ""
    return {"gravity": "base.orientation", "body_velocity": "base.velocity"}.get(signal, signal)


def source_of_part(signal: str, layout: Layout) -> Source:
    """Return a signal that is computed from an observation alone."""
    place = layout[find_part(signal)]
    if signal == "gravity":
        return Source(AXES, lambda seen, _: turn_back(seen[place], np.array([0.0, 0.0, -1.0])))
    if signal == "body_velocity":
        turned = layout["base.orientation"]
        return Source(AXES, lambda seen, _: turn_back(seen[turned], seen[place]))
    return Source(part_names(signal, layout), lambda seen, _: seen[place])


def part_names(part: str, layout: Layout) -> tuple[str, ...]:
    """Return what the numbers of a part of an observation are called."""
    if part in OF_JOINTS:
        return layout.joints
    if part == "state":
        return tuple(map(str, range(layout.states)))
    return tuple(column.removeprefix(f"{part}.") for column in layout.columns[part])


def phase_source(frequency: float) -> Source:
    """Return a clock: sine and cosine of its phase."""

    def read(_: np.ndarray, episode: Episode) -> np.ndarray:
        phase = 2.0 * np.pi * frequency * episode.time
        return np.array([np.sin(phase), np.cos(phase)])

    return Source(("sin", "cos"), read)


def constant_source(values: Sequence[float]) -> Source:
    """Return numbers that never change, such as a commanded velocity."""
    numbers = np.array(values, dtype=float)
    return Source(tuple(map(str, range(len(numbers)))), lambda _, __: numbers)


def turn_back(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return a vector of the world in body axes, shape (3,).

    Args:
        quaternion: Orientation of the body in the world (x, y, z, w), shape (4,).
        vector: In world axes, shape (3,).
    """
    axis, w = quaternion[:3], quaternion[3]
    cross = np.cross(axis, vector)
    return np.asarray(vector - 2.0 * w * cross + 2.0 * np.cross(axis, cross))
