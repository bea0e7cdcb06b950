"""A record is a logged trajectory as a replay wants it: targets in, measured joints out; pieces are its windows."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy
from scipy.spatial.transform import Rotation

from gsl.core.body import Robot
from gsl.core.other_commands import (
    find_varying_gains,
    has_other_commands,
    read_other_commands,
    split_other_commands,
)
from gsl.core.trajectory import Batch, Trajectory
from gsl.core.transitions import usable
from gsl.errors import GslError
from gsl.worlds.held import Windows
from gsl.worlds.servo_state import COMMANDS

BASE = ("base.x", "base.y", "base.z", "base.roll", "base.pitch", "base.yaw")
LOADED = 3.0  # on a foot that stands [N]
FEW = 5  # records over which no bootstrap is drawn: its intervals would be far too narrow
SMOOTHER, LONGEST, SHORTEST = 7, 0.14, 0.06  # rows of the cubic whose slope is a velocity; and at most, at least [s]


@dataclass(frozen=True)
class Record:
    """One trajectory of T control periods.

    Attributes:
        name: Which motion it is, the same for repeats.
        targets: Of the motors [rad], shape (T, n_motors).
        position: Measured before each command and after the last one [rad], shape (T + 1, n_joints).
        velocity: Slope of a smoother through the positions [rad/s], shape (T + 1, n_joints).
        base: Of a robot on the ground: place [m] and roll, pitch, yaw [rad] as in BASE, quaternion, velocity in world
            axes [m/s], angular velocity in base axes [rad/s], shape (T + 1, 16); None in the air.
        feet: Whether the left and the right foot carry load, shape (T + 1, 2), if it was logged.
        sensors: Further columns of the log by name, each of shape (T + 1,).
        about: What the log says of the trajectory: its label.
        beside: Desired speeds [rad/s], then feed-forward torques [N·m], that came with the targets, shape
            (T, 2 n_motors), and shares of kp and kd where gains vary, (T, 4 n_motors); None where the log has none.
    """

    name: str
    targets: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    base: np.ndarray | None = None
    feet: np.ndarray | None = None
    sensors: Mapping[str, np.ndarray] = field(default_factory=dict)
    about: Mapping[str, Any] = field(default_factory=dict)
    beside: np.ndarray | None = None

    @property
    def commands(self) -> np.ndarray:
        """All that the servos were sent, shape (T, n_motors), or 3 or 5 times as wide with what came beside."""
        return self.targets if self.beside is None else np.hstack([self.targets, self.beside])

    @property
    def conditions(self) -> Mapping[str, Any]:
        """Effects that act in this trajectory for sure: a payload, other gains, a tilted base."""
        conditions: Mapping[str, Any] = self.about.get("conditions") or {}
        return conditions

    @property
    def driven(self) -> np.ndarray:
        """Whether the torque of all joints is on, shape (T + 1,); one that is off follows no command."""
        flags = [values for key, values in self.sensors.items() if key.partition(".")[0] == "enabled"]
        return np.all([np.ones(len(self) + 1), *flags], axis=0)

    def __len__(self) -> int:
        """Control periods T."""
        return len(self.targets)

    @property
    def measured(self) -> np.ndarray:
        """Joints, and the base's place and angles if it moves, shape (T + 1, n_channels)."""
        return self.position if self.base is None else np.hstack([self.position, self.base[:, : len(BASE)]])

    def cut_to_driven(self) -> Record:
        """Return the part from where torque is first on to where it is switched off; maybe of no control period."""
        works = self.driven[: len(self)]
        first = int(np.argmax(works)) if works.any() else len(self)
        off = np.flatnonzero(~works[first:])
        last = first + int(off[0]) if len(off) else len(self)
        rows = slice(first, last + 1)
        return replace(
            self,
            targets=self.targets[first:last],
            beside=None if self.beside is None else self.beside[first:last],
            position=self.position[rows],
            velocity=self.velocity[rows],
            sensors={key: values[rows] for key, values in self.sensors.items()},
        )


def to_records(batch: Batch, robot: Robot, *, walking: bool = False) -> tuple[Record, ...]:
    """Return a batch's trajectories as records, in order, each up to its fall.

    Args:
        batch: Its joints are the robot's controlled ones.
        robot: Whose motors follow.
        walking: Whether the base moves and is logged.
    """
    order = [batch.joints.index(joint) for joint in robot.controlled]
    varies = next(find_varying_gains([episode.sensors for episode in batch.episodes], batch.joints), None) is not None
    wide = has_other_commands(batch)
    return tuple(
        _to_record(label, episode, order, robot, batch.control_period, walking=walking, wide=wide, gains=varies)
        for label, episode in zip(labels_of(batch), batch.episodes, strict=True)
    )


def labels_of(batch: Batch) -> Sequence[Mapping[str, Any]]:
    """Return what a batch says about each of its trajectories."""
    labels = batch.metadata.get("episodes") or []
    return labels if len(labels) == len(batch) else [{}] * len(batch)


def _to_record(
    label: Mapping[str, Any], episode: Trajectory, order: Sequence[int], robot: Robot, period: float, *,
    walking: bool, wide: bool, gains: bool,
) -> Record:  # fmt: skip
    ticks = usable(episode)
    position = episode.position[: ticks + 1, order]
    base = _base(episode, period)[: ticks + 1] if walking else None
    steps = "foot_force.left" in episode.sensors
    feet = _columns(episode, "foot_force", ("left", "right"))[: ticks + 1] > LOADED if steps else None
    sensors = {column: values[: ticks + 1] for column, values in episode.sensors.items()}
    targets = episode.action[:ticks][:, order][:, robot.drive]
    beside = read_other_commands(episode, robot, gains=gains)[:ticks] if wide else None
    name = str(label.get("policy", ""))
    return Record(name, targets, position, slope(position, period), base, feet, sensors, label, beside)


def _base(episode: Trajectory, period: float) -> np.ndarray:
    """Return the base columns of a record; velocities are the log's own, else slopes."""
    place = _columns(episode, "base.position", "xyz")
    quaternion = _columns(episode, "base.orientation", "xyzw")
    turn = Rotation.from_quat(quaternion)
    angles = np.unwrap(turn.as_euler("ZYX")[:, ::-1], axis=0)
    logged = "base.velocity.x" in episode.sensors
    velocity = _columns(episode, "base.velocity", "xyz") if logged else slope(place, period)
    gyro = _columns(episode, "gyro", "xyz") if "gyro.x" in episode.sensors else _spin(turn, period)
    return np.hstack([place, angles, quaternion, velocity, gyro])


def _columns(episode: Trajectory, name: str, axes: Sequence[str]) -> np.ndarray:
    return np.stack([episode.sensors[f"{name}.{axis}"] for axis in axes], axis=1)


def _spin(turn: Rotation, period: float) -> np.ndarray:
    """Return the angular velocity in base axes from one tick to the next [rad/s], shape (T + 1, 3)."""
    steps = (turn[:-1].inv() * turn[1:]).as_rotvec() / period
    return np.vstack([steps, steps[-1:]])


def slope(position: np.ndarray, period: float) -> np.ndarray:
    """Return a smoother's velocities [rad/s] through positions [rad], (T + 1, n_joints); NaN if these diverge."""
    if not np.isfinite(position).all():
        return np.full_like(position, np.nan)
    rows = max(3, min(SMOOTHER, round(LONGEST / period)), round(SHORTEST / period)) // 2 * 2 + 1
    length = min(rows, len(position) - (len(position) + 1) % 2)
    return scipy.signal.savgol_filter(
        position, length, min(3, length - 1), deriv=1, delta=period, axis=0, mode="interp"
    )


class OnGround(NamedTuple):
    """Windows of a robot on the ground; see `held.Windows` for the first three.

    Attributes:
        base: At the beginning, as in `Record`, shape (W, 16).
    """

    commands: np.ndarray
    motion: np.ndarray
    clock: np.ndarray
    base: np.ndarray

    @property
    def length(self) -> int:
        """Control periods of a window, T."""
        return self.commands.shape[1] - COMMANDS + 1


@dataclass(frozen=True)
class Pieces:
    """Windows of records and what was measured in them.

    Attributes:
        windows: To replay; on the ground with the base at the beginning.
        real: Measured after each control period, shape (W, T, n_channels): joints [rad], then BASE if it moves.
        record: Index of each window's record, shape (W,).
        tick: Control period at which each begins, shape (W,).
        warm_up: Control periods at the beginning that are not scored.
        conditions: Effects that act in each record for sure; empty where none does in any.
    """

    windows: Windows | OnGround
    real: np.ndarray
    record: np.ndarray
    tick: np.ndarray
    warm_up: int
    conditions: tuple[Mapping[str, Any], ...] = ()

    def __len__(self) -> int:
        """Number of windows."""
        return len(self.tick)

    @property
    def scored(self) -> int:
        """Control periods of a window that are scored."""
        return self.real.shape[1] - self.warm_up

    @property
    def wide(self) -> bool:
        """Whether other commands came beside the positions."""
        return bool(self.windows.commands.shape[2] > self.windows.motion.shape[2])

    @property
    def samples(self) -> np.ndarray:
        """Index of what a bootstrap draws, shape (W,): records if there are enough of them, else single windows."""
        few = len(np.unique(self.record)) < FEW
        return np.arange(len(self)) if few else self.record

    def targets(self, joints: int) -> np.ndarray:
        """Return what the first joints were commanded in each control period [rad], shape (W, T, joints)."""
        return self.windows.commands[:, : self.real.shape[1], :joints][:, ::-1]

    def beside(self, joints: int) -> tuple[np.ndarray, ...]:
        """Return desired speeds [rad/s], feed-forward torques [N·m] and shares of kp and kd, each as `targets` are."""
        commands, motors = self.windows.commands[:, : self.real.shape[1]][:, ::-1], self.windows.motion.shape[2]
        return tuple(part[..., :joints] for part in split_other_commands(commands, motors))

    def take(self, index: np.ndarray) -> Pieces:
        """Return some of the windows."""
        windows = type(self.windows)(*(part[index] for part in self.windows))
        return Pieces(windows, self.real[index], self.record[index], self.tick[index], self.warm_up, self.conditions)

    @cached_property
    def alike(self) -> list[tuple[Mapping[str, Any], np.ndarray]]:
        """Windows by their conditions: these effects, and indices, shape (n,)."""
        if not self.conditions:
            return [({}, np.arange(len(self)))]
        kinds = group_alike([self.conditions[k] for k in self.record])
        return [(self.conditions[self.record[index[0]]], index) for index in kinds]


def group_alike(conditions: Sequence[Mapping[str, Any]]) -> list[np.ndarray]:
    """Return the indices of those that are alike, group by group, shapes (n,)."""
    texts = [json.dumps(effects, sort_keys=True, default=str) for effects in conditions]
    return [np.array([k for k, other in enumerate(texts) if other == text]) for text in dict.fromkeys(texts)]


def cut_pieces(records: Sequence[Record], robot: Robot, period: float, *, warm_up: int, scored: int) -> Pieces:
    """Cut records into windows, one after the other with the scored parts side by side.

    Args:
        records: To cut.
        robot: Theirs.
        period: Control period [s].
        warm_up: Control periods at the beginning of a window that are not scored.
        scored: Control periods that are.

    Raises:
        GslError: if no record is long enough for a window.
    """
    drive, length = robot.drive, warm_up + scored
    commands, motion, real, index, tick, base = [], [], [], [], [], []
    conditions = tuple(record.conditions for record in records) if any(r.conditions for r in records) else ()
    for number, record in enumerate(records):
        sent = record.commands
        padded = np.vstack([np.repeat(sent[:1], COMMANDS, axis=0), sent])
        works = record.driven
        for start in range(0, len(record) - length + 1, scored):
            if not works[start : start + length].all():
                continue
            commands.append(padded[start + 1 : start + COMMANDS + length][::-1])
            motion.append([record.position[start, drive], record.velocity[start, drive]])
            real.append(record.measured[start + 1 : start + 1 + length])
            base.append(None if record.base is None else record.base[start])
            index.append(number)
            tick.append(start)
    if not tick:
        raise GslError(
            f"no trajectory lasts {length * period:g} s before its robot falls or its log ends, as a replay needs; "
            "log longer ones"
        )
    parts = np.array(commands), np.array(motion), period * np.array(tick, dtype=float)
    windows = Windows(*parts) if base[0] is None else OnGround(*parts, np.array(base))
    return Pieces(windows, np.array(real), np.array(index), np.array(tick), warm_up, conditions)
