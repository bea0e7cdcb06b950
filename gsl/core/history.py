"""The history window: what a learned model sees of the ticks up to now, relative to where the joints are now."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

BODY_SENSORS = {"gyro": 3, "tilt": 2, "foot_force": 2}
"""Number of entries of each body sensor a window may hold."""

RESTING = 0.1  # [rad]; how far from where it rests a robot may be held; an SO-101 hangs .08 below its target


@dataclass(frozen=True)
class History:
    """What a window holds, in this order.

        a_t - x_t | x_t | x_{t-1} - x_t, ..., x_{t-k} - x_t | a_{t-1} - x_t, ..., a_{t-k} - x_t | sensors t, t-1, ...

    Attributes:
        ticks: Past positions and past actions, k each.
        sensors: Names out of `BODY_SENSORS`.
        sensor_ticks: Ticks of each sensor, the present one included.
        rested: Whether episodes begin at rest, so that there are windows of their first ticks as well.
    """

    ticks: int = 3
    sensors: tuple[str, ...] = ()
    sensor_ticks: int = 2
    rested: bool = False

    @property
    def sensor_entries(self) -> int:
        """Number of sensor entries of one tick."""
        return sum(BODY_SENSORS[name] for name in self.sensors)

    @property
    def span(self) -> int:
        """Ticks before the present one that a window needs."""
        return max(self.ticks, self.sensor_ticks - 1 if self.sensors else 0)

    def size(self, n_joints: int) -> int:
        """Return the length of a window."""
        return (2 + 2 * self.ticks) * n_joints + self.sensor_ticks * self.sensor_entries


def windows(
    history: History, position: np.ndarray, action: np.ndarray, sensed: np.ndarray, ticks: np.ndarray
) -> np.ndarray:
    """Return one window for each of `ticks`, shape (len(ticks), history.size(n_joints)).

    Args:
        history: What a window holds.
        position: Joint positions x [rad], shape (T + 1, n_joints).
        action: Actions a [rad], shape (T, n_joints).
        sensed: Body sensors, shape (T + 1, history.sensor_entries).
        ticks: Each at least `history.span` and less than T.
    """
    return np.concatenate(window_parts(history, position, action, sensed, ticks), axis=1)


def window_parts(history: History, position: Any, action: Any, sensed: Any, ticks: Any) -> list[Any]:
    """Return what windows are laid together from, of whatever `ticks` index: arrays, or tensors by tick."""
    now, back = position[ticks], range(1, history.ticks + 1)
    parts = [action[ticks] - now, now]
    parts += [position[ticks - i] - now for i in back]
    parts += [action[ticks - i] - now for i in back]
    return parts + [sensed[ticks - i] for i in range(history.sensor_ticks if history.sensors else 0)]


def find_rest_action(action: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return what held a robot at rest before its first action [rad]: this, or where it is if that is farther away."""
    return np.where(np.abs(action - position) <= RESTING, action, position)


def with_rest(
    history: History, position: np.ndarray, action: np.ndarray, sensed: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, actions and body sensors of an episode with as many ticks of rest before it as a window needs.

    Args:
        history: What a window holds.
        position: See `windows`, as the others.
        action: The episode's.
        sensed: Body sensors.
    """

    def after(first: np.ndarray, column: np.ndarray) -> np.ndarray:
        return np.concatenate([np.repeat(first, history.span, axis=0), column])

    rest = find_rest_action(action[:1], position[:1])
    return after(position[:1], position), after(rest, action), after(sensed[:1], sensed)


def tilt(x: Any, y: Any, z: Any, w: Any) -> tuple[Any, Any]:
    """Return the first two entries of the upward direction in body axes, of one quaternion or of arrays of them."""
    return 2.0 * (x * z - y * w), 2.0 * (y * z + x * w)


class Window:
    """The window of an episode as it goes on: `see` what is measured, `complete` it with an action, `remember` one.

    Before the first tick the robot is taken to have rested; in the middle of a motion the first `span` windows guess.
    """

    def __init__(self, history: History, n_joints: int) -> None:
        k, wide = history.ticks, history.sensor_entries
        self._raw, self._values = np.zeros((2 + 2 * k, n_joints)), np.zeros(history.size(n_joints))
        self._joints = self._values[: self._raw.size].reshape(self._raw.shape)
        self._here = self._joints[1]
        self._action, self._position, self._past_actions = self._raw[0], self._raw[1], self._raw[2 + k :]
        self._positions = self._raw[2 : 2 + k], self._raw[1 : 1 + k]
        self._actions = self._raw[3 + k :], self._raw[2 + k : -1]
        sensed = self._values[self._raw.size :]
        self._sensed = sensed.reshape(-1, wide) if wide else None
        self._fresh = True

    def see(self, position: np.ndarray, sensed: np.ndarray | Sequence[float]) -> None:
        """Take in the joint positions [rad], shape (n_joints,), and body sensors, shape (history.sensor_entries,)."""
        older, newer = self._positions
        older[:] = position if self._fresh else newer
        self._position[:] = position
        if self._sensed is not None:
            self._sensed[1:] = sensed if self._fresh else self._sensed[:-1]
            self._sensed[0] = sensed

    def complete(self, action: np.ndarray) -> np.ndarray:
        """Return the window with an action [rad], shape (n_joints,); the array is used again at the next call."""
        if self._fresh:
            self._past_actions[:] = find_rest_action(action, self._position)
            self._fresh = False
        self._action[:] = action
        np.subtract(self._raw, self._position, out=self._joints)
        self._here[:] = self._position
        return self._values

    def remember(self, action: np.ndarray) -> None:
        """Take in the action that was carried out in this tick [rad], shape (n_joints,)."""
        older, newer = self._actions
        older[:] = newer
        self._past_actions[:1] = action
