"""What a robot tells: the dictionary of its `read`, checked, as an observation and as columns of a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gsl.core.layout import Layout
from gsl.errors import GslError

BODY = {"base.position": 3, "base.orientation": 4, "base.velocity": 3, "acceleration": 3, "voltage": 1}
JOINTS = ("torque", "temperature")
FELL = "fell"


class RobotError(GslError):
    """What the robot tells, or its interface, does not fit the request."""


class Seen(NamedTuple):
    """One reading: observation, shape (layout.size,), further columns by name, and whether the robot lies down."""

    observation: np.ndarray
    more: Mapping[str, float]
    fell: bool


class Senses:
    """Reads one episode of a robot whose observations have a layout; velocities may be left to us."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._before: tuple[float, np.ndarray] | None = None

    def interpret(self, reading: Mapping[str, Any], now: float) -> Seen:
        """Return what a dictionary of `read` says at a time [s].

        Raises:
            RobotError: Something is missing, of another size, not finite or unknown.
        """
        if not isinstance(reading, Mapping):
            raise RobotError(f"read() gives {type(reading).__name__}, not a dictionary")
        n, sizes = len(self._layout.joints), self._layout.sizes
        allowed = {**sizes, **BODY, **dict.fromkeys(JOINTS, n), FELL: 1}
        for name in reading:
            if name not in allowed:
                raise RobotError(f"read() gives '{name}', which is none of {', '.join(sorted(allowed))}")
        values = {name: _numbers(name, value, allowed[name]) for name, value in reading.items() if name != FELL}
        values = self._with_velocity(values, now)
        for name in sizes:
            if name not in values:
                raise RobotError(f"read() gives no '{name}', which the policies need")
        observation = np.concatenate([values[name] for name in sizes])
        more = {name: value for name, value in values.items() if name not in sizes}
        return Seen(observation, _columns(more, self._layout.joints), _yes(reading.get(FELL, False)))

    def _with_velocity(self, values: dict[str, np.ndarray], now: float) -> dict[str, np.ndarray]:
        """Add the difference of positions where a robot has no velocities."""
        if "velocity" in values or "position" not in values:
            return values
        at, before = self._before or (now, values["position"])
        self._before = now, values["position"]
        seconds = max(now - at, 0.5 * self._layout.control_period)
        return {**values, "velocity": (values["position"] - before) / seconds}


def names_of(layout: Layout) -> list[str]:
    """Return the columns of an observation, in order."""
    joints = {part: [f"{part}.{joint}" for joint in layout.joints] for part in ("position", "velocity")}
    return [name for part in layout.sizes for name in joints.get(part) or layout.columns[part]]


def _yes(value: Any) -> bool:
    if not isinstance(value, bool | np.bool_ | int) or value not in (0, 1):
        raise RobotError(f"read() gives for '{FELL}' {value!r}, which is neither True nor False")
    return bool(value)


def _numbers(name: str, value: Any, size: int) -> np.ndarray:
    try:
        numbers = np.atleast_1d(np.array(value, dtype=float))
    except (TypeError, ValueError) as error:
        raise RobotError(f"read() gives for '{name}' what is no list of numbers") from error
    if numbers.shape != (size,):
        shape = "" if numbers.ndim == 1 else f" in the shape {numbers.shape}"
        raise RobotError(f"read() gives {numbers.size} numbers{shape} for '{name}', not {size}")
    if not np.isfinite(numbers).all():
        raise RobotError(f"read() gives for '{name}' a number that is not finite")
    return numbers


def _columns(parts: Mapping[str, np.ndarray], joints: Sequence[str]) -> dict[str, float]:
    body = Layout(tuple(joints), {name: len(value) for name, value in parts.items() if name not in JOINTS}, 1.0)
    named = {name: [f"{name}.{joint}" for joint in joints] for name in JOINTS} | dict(body.columns)
    return {
        column: number
        for name, value in parts.items()
        for column, number in zip(named[name], value.tolist(), strict=True)
    }
