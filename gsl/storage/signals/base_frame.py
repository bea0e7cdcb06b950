"""The base's columns: the order of a quaternion, and whether velocities are in world or in body axes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from gsl.core.trajectory import Trajectory
from gsl.storage.signals.finding import Finding

NORM = 0.02  # by which the norm of a quaternion may be off 1
BETTER = 0.5  # times the error of what is written that another reading has to stay below
STILL_TURN, STILL_SPEED = 0.05, 0.02  # rms of a base that hardly turns [rad/s] or moves [m/s]: nothing shows
UPRIGHT = 0.7  # mean cosine from which on a base is upright, and below whose negative it is upside down
ORIENTATION, VELOCITY, PLACE, GYRO = "base.orientation", "base.velocity", "base.position", "gyro"


def find_base_frames(episodes: Sequence[Trajectory]) -> list[Finding]:
    """Return what is wrong with the base's columns, none where there are none."""
    some = [episode for episode in episodes if f"{ORIENTATION}.w" in episode.sensors and len(episode) > 2]
    if not some:
        return []
    wrong = _norm(some) or [*_order(some)]
    return wrong or [*_frame_of_gyro(some), *_frame_of_velocity(some)]


def _read(episode: Trajectory, name: str, axes: str) -> np.ndarray | None:
    columns = [episode.sensors.get(f"{name}.{axis}") for axis in axes]
    return None if any(column is None for column in columns) else np.stack([*map(np.asarray, columns)], axis=1)


def _quaternions(episode: Trajectory) -> np.ndarray:
    values = _read(episode, ORIENTATION, "xyzw")
    assert values is not None
    return values


def _columns(name: str, axes: str) -> tuple[str, ...]:
    return tuple(f"{name}.{axis}" for axis in axes)


def _norm(some: Sequence[Trajectory]) -> list[Finding]:
    worst = max(float(np.abs(np.linalg.norm(_quaternions(episode), axis=1) - 1.0).max()) for episode in some)
    if worst <= NORM:
        return []
    problem = f"is no unit quaternion (its norm is up to {worst:.2g} off 1)"
    remedy = "say which column is which of x, y, z, w"
    return [Finding("base_frame", _columns(ORIENTATION, "xyzw"), (), problem, remedy)]


def _order(some: Sequence[Trajectory]) -> Iterator[Finding]:
    """Yield a quaternion whose scalar comes first: by its rates where a gyro is logged, else by what is up."""
    errors = {order: _spin_error(some, order) for order in ("xyzw", "wxyz")}
    if errors["xyzw"] is not None and errors["wxyz"] is not None:
        wrong = errors["wxyz"] < BETTER * errors["xyzw"]
    else:
        up = {order: float(np.mean(np.concatenate([_turns(episode, order).as_matrix()[:, 2, 2] for episode in some])))
              for order in ("xyzw", "wxyz")}  # fmt: skip
        wrong = up["wxyz"] > UPRIGHT and up["xyzw"] < 0.0
    if wrong:
        problem = "is written w, x, y, z, and read x, y, z, w"
        remedy = f"name the columns in the mapping ({ORIENTATION}: {{column: [q1, q2, q3, q0]}})"
        yield Finding("base_frame", _columns(ORIENTATION, "xyzw"), (), problem, remedy)


def _turns(episode: Trajectory, order: str = "xyzw") -> Rotation:
    values = _quaternions(episode)
    return Rotation.from_quat(values if order == "xyzw" else values[:, [1, 2, 3, 0]])


def _spins(episode: Trajectory, order: str = "xyzw") -> np.ndarray:
    """Return the angular velocities in body axes from one row to the next [rad/s], shape (T, 3)."""
    turns = _turns(episode, order)
    return (turns[:-1].inv() * turns[1:]).as_rotvec() / np.diff(episode.time)[:, None]


def _spin_error(some: Sequence[Trajectory], order: str) -> float | None:
    """Return how far a gyro is off the rates of the quaternion [rad/s, rms]; None without one, or if nothing turns."""
    gyros = [_read(episode, GYRO, "xyz") for episode in some]
    if any(gyro is None for gyro in gyros):
        return None
    measured = np.concatenate([0.5 * (g[1:] + g[:-1]) for g in gyros if g is not None])
    if _rms(measured) < STILL_TURN:
        return None
    return _rms(measured - np.concatenate([_spins(episode, order) for episode in some]))


def _frame_of_gyro(some: Sequence[Trajectory]) -> Iterator[Finding]:
    body = _spin_error(some, "xyzw")
    if body is None:
        return
    spins = [(_turns(episode)[:-1].apply(_spins(episode)), _read(episode, GYRO, "xyz")) for episode in some]
    world = _rms(np.concatenate([0.5 * (g[1:] + g[:-1]) - spin for spin, g in spins if g is not None]))
    yield from _say(GYRO, {"body": body, "world": world}, "body")


def _frame_of_velocity(some: Sequence[Trajectory]) -> Iterator[Finding]:
    world, body = [], []
    for episode in some:
        place, speed = _read(episode, PLACE, "xyz"), _read(episode, VELOCITY, "xyz")
        if place is None or speed is None:
            return
        slope, middle = np.diff(place, axis=0) / np.diff(episode.time)[:, None], 0.5 * (speed[1:] + speed[:-1])
        world.append(middle - slope)
        body.append(_turns(episode)[:-1].apply(middle) - slope)
        if _rms(slope) < STILL_SPEED:
            return
    yield from _say(VELOCITY, {"world": _rms(np.concatenate(world)), "body": _rms(np.concatenate(body))}, "world")


def _say(name: str, errors: Mapping[str, float], due: str) -> Iterator[Finding]:
    other = next(frame for frame in errors if frame != due)
    if errors[other] < BETTER * errors[due]:
        problem = f"is in {other} axes; the contract wants {due} axes"
        yield Finding("base_frame", _columns(name, "xyz"), (), problem, "turn it by base.orientation before the import")


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(values**2, axis=-1))))
