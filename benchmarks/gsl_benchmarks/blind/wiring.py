"""Wiring faults of known kind and joint, put into a robot's log as loggers, drivers and mappings do."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.plant import Plant
from gsl.core.trajectory import Batch
from gsl.diagnosis.log.records import slope

Arrays = Callable[[np.ndarray], np.ndarray]
DEGREES, TICKS = 180.0 / np.pi, 4096.0 / (2.0 * np.pi)
OFFSET = (0.15, 0.5)  # of a default pose [rad]: twice the documented zero offset, and more
GLITCH = (0.15, 0.6)  # [rad]
RATES = (0.5, 2.0, 0.25)
GAINS = (8.0, 1.0 / 20.0, 57.3, 1.0 / 57.3)


@dataclass(frozen=True)
class Wired:
    """A log with a wiring fault, and the simulator that it is set against.

    Attributes:
        log: What is handed out.
        plant: The simulator that is handed out.
        kind: Of the fault.
        joints: That have it.
    """

    log: Batch
    plant: Plant
    kind: str
    joints: tuple[str, ...]


Play = Callable[[Sequence[np.ndarray]], Batch]
"""What a robot logs when its servos get these commands, each of shape (T, n_joints)."""


def wire(kind: str, commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    """Return a log with a fault.

    Args:
        kind: One of `KINDS`.
        commands: That are logged, shape (T, n_joints) each.
        play: The robot.
        plant: The right simulator.
        rng: Of everything that is drawn.
    """
    return KINDS[kind](commands, play, plant, rng)


def change(batch: Batch, *, action: Arrays | None = None, position: Arrays | None = None) -> Batch:
    """Return a log with other commands or positions; velocities are the slopes that a logger would derive."""
    episodes = []
    for episode in batch.episodes:
        measured = position(episode.position.copy()) if position else episode.position
        commands = action(episode.action.copy()) if action else episode.action
        speed = slope(measured, batch.control_period) if position else episode.velocity
        episodes.append(replace(episode, action=commands, position=measured, velocity=speed))
    return replace(batch, episodes=tuple(episodes))


def _names(batch: Batch, index: Sequence[int]) -> tuple[str, ...]:
    return tuple(batch.joints[k] for k in sorted(index))


def _moving(batch: Batch) -> np.ndarray:
    """Return the joints that move, of which a fault can show, shape (k,)."""
    ranges = np.ptp(np.concatenate([episode.action for episode in batch.episodes]), axis=0)
    return np.flatnonzero(ranges > 0.1)


def _some(batch: Batch, rng: np.random.Generator, count: int) -> list[int]:
    moving = _moving(batch)
    return [int(k) for k in rng.choice(moving, size=min(count, len(moving)), replace=False)]


def _columns(columns: Sequence[int], how: Arrays) -> Arrays:
    def alter(x: np.ndarray) -> np.ndarray:
        x[:, list(columns)] = how(x[:, list(columns)])
        return x

    return alter


def _on_a_side(batch: Batch, how: Arrays, rng: np.random.Generator) -> Batch:
    return change(batch, action=how) if rng.random() < 0.5 else change(batch, position=how)


def _permute(commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    log = play(commands)
    chosen = _some(log, rng, int(rng.choice([2, 3])))
    order = np.arange(len(log.joints))
    order[chosen] = np.roll(chosen, 1)
    return Wired(_on_a_side(log, lambda x: x[:, order], rng), plant, "permuted", _names(log, chosen))


def _sign(commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    log = play(commands)
    chosen = _some(log, rng, int(rng.choice([1, 2])))
    return Wired(_on_a_side(log, _columns(chosen, np.negative), rng), plant, "sign", _names(log, chosen))


def _scale(commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    """Degrees, ticks, or shares of the joints' ranges; of the commands, of the positions, or of both."""
    log = play(commands)
    lower, upper = _ranges(lump(plant.robot))
    every = list(range(len(log.joints)))
    units: list[Arrays] = [
        lambda x: DEGREES * x,
        lambda x: np.round(2048.0 + TICKS * x),
        lambda x: 200.0 * (x - lower) / (upper - lower) - 100.0,
    ]
    unit = units[int(rng.integers(len(units)))]
    side = int(rng.integers(3))
    made = change(log, action=unit if side != 1 else None, position=unit if side != 0 else None)
    return Wired(made, plant, "scale", _names(log, every))


def _ranges(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    joints = [robot.joint(name) for name in robot.controlled]
    return np.array([joint.lower for joint in joints]), np.array([joint.upper for joint in joints])


def _offset(commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    log = play(commands)
    chosen = _some(log, rng, int(rng.choice([1, 2, 3])))
    sizes = rng.uniform(*OFFSET, len(chosen)) * rng.choice([-1.0, 1.0], len(chosen))
    return Wired(_on_a_side(log, _columns(chosen, lambda x: x - sizes), rng), plant, "offset", _names(log, chosen))


def _gains(commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    """The simulator's gains are those of another servo, or per degree."""
    log, factor = play(commands), float(rng.choice(GAINS))
    kd = factor if rng.random() < 0.5 else 1.0
    servo = plant.servo
    wrong = plant.with_servo(kp=servo.kp * factor, kd=servo.kd * kd)
    return Wired(log, wrong, "gains", tuple(log.joints))


def _rate(commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    log, factor = play(commands), float(rng.choice(RATES))
    episodes = tuple(
        replace(episode, time=factor * episode.time, velocity=episode.velocity / factor) for episode in log.episodes
    )
    made = replace(log, episodes=episodes, control_period=factor * log.control_period)
    return Wired(made, plant, "rate", tuple(log.joints))


def _hold(commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    ticks = int(rng.choice([2, 3, 4]))
    phase = int(rng.integers(ticks))
    taken = [np.maximum(phase + (np.arange(len(command)) - phase) // ticks * ticks, 0) for command in commands]
    log = play([command[rows] for command, rows in zip(commands, taken, strict=True)])
    episodes = tuple(replace(episode, action=asked) for episode, asked in zip(log.episodes, commands, strict=True))
    return Wired(replace(log, episodes=episodes), plant, "hold", tuple(log.joints))


def _shift(commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    """A command is written one or two rows after the row from which it acted."""
    log, rows = play(commands), int(rng.choice([1, 1, 2]))
    late: Arrays = lambda x: np.vstack([np.repeat(x[:1], rows, axis=0), x[:-rows]])  # noqa: E731
    return Wired(change(log, action=late), plant, "shift", tuple(log.joints))


def _wrap(commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    """An encoder's zero lies within the motion of a joint."""
    log = play(commands)
    joint = _some(log, rng, 1)[0]
    middle = float(np.median(np.concatenate([episode.position[:, joint] for episode in log.episodes])))
    low, high = (
        np.quantile(np.concatenate([episode.position[:, joint] for episode in log.episodes]), q) for q in (0.3, 0.7)
    )
    cut = middle if high - low < 0.05 else float(rng.uniform(low, high))
    how = _columns([joint], lambda x: np.mod(x - cut, 2.0 * np.pi))
    return Wired(change(log, position=how), plant, "wrap", (log.joints[joint],))


def _glitch(commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    log = play(commands)
    joint, episodes = _some(log, rng, 1)[0], list(log.episodes)
    for number in rng.choice(len(episodes), size=min(3, len(episodes)), replace=False):
        position = episodes[number].position.copy()
        row = int(rng.integers(10, len(position) - 10))
        position[row, joint] += rng.uniform(*GLITCH) * rng.choice([-1.0, 1.0])
        episodes[number] = replace(episodes[number], position=position)
    return Wired(replace(log, episodes=tuple(episodes)), plant, "glitch", (log.joints[joint],))


def _frozen(commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    """From some row of the log on a position stays what it was."""
    log = play(commands)
    joint, first = _some(log, rng, 1)[0], int(rng.integers(0, max(1, len(log.episodes) // 2)))
    episodes, last = list(log.episodes), 0.0
    for number, episode in enumerate(episodes[first:], first):
        position = episode.position.copy()
        row = int(rng.integers(20, len(position) // 2)) if number == first else 0
        last = float(position[row, joint]) if number == first else last
        position[row:, joint] = last
        episodes[number] = replace(episode, position=position)
    return Wired(replace(log, episodes=tuple(episodes)), plant, "frozen", (log.joints[joint],))


def _stale(commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    """A position is read in every second or third row only."""
    log = play(commands)
    joint, every = _some(log, rng, 1)[0], int(rng.choice([2, 3]))
    how: Arrays = lambda x: x[np.arange(len(x)) // every * every]  # noqa: E731
    return Wired(change(log, position=_columns([joint], how)), plant, "stale", (log.joints[joint],))


def _copy(commands: Sequence[np.ndarray], play: Play, plant: Plant, rng: np.random.Generator) -> Wired:
    """What is logged as the command is the position of this row or of the next one."""
    log, row = play(commands), int(rng.integers(2))
    episodes = tuple(
        replace(episode, action=episode.position[row : row + len(episode)].copy()) for episode in log.episodes
    )
    return Wired(replace(log, episodes=episodes), plant, "copy", tuple(log.joints))


KINDS: Mapping[str, Callable[[Sequence[np.ndarray], Play, Plant, np.random.Generator], Wired]] = {
    "permuted": _permute, "sign": _sign, "scale": _scale, "offset": _offset, "gains": _gains, "rate": _rate,
    "hold": _hold, "shift": _shift, "wrap": _wrap, "glitch": _glitch, "frozen": _frozen, "stale": _stale,
    "copy": _copy,
}  # fmt: skip
