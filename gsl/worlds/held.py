"""Replays of a robot held in the air: recorded commands from measured states, through servos and chain.

The windows of a log do not know of each other: eight are replayed side by side (`lanes`) in the time of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gsl.core.body import Robot, carrier
from gsl.core.compiled import compile_inner, compile_kernel
from gsl.core.lanes import LANES, side_by_side, zeros_in_lanes
from gsl.core.plant import Plant, Push, hardness
from gsl.core.servo_law import HIDDEN, LAYERS
from gsl.errors import ConfigError
from gsl.worlds.chain import COLUMNS, Chain, Pushed, accelerate, chain
from gsl.worlds.encoder import REMEMBERED
from gsl.worlds.pushes import acting
from gsl.worlds.servo import encoder_motion, servo_torque
from gsl.worlds.servo_state import COMMANDS, MEMORY, ROTOR, SPEED, ServoParameters, ServoState, pack, settle

RUNAWAY = 1e3  # speed at which a replay has no meaning any more [rad/s]


class Windows(NamedTuple):
    """Pieces of logs to replay, W of them, T control periods each.

    Attributes:
        commands: Newest first, the last of the window to the oldest before it, see `ServoState`: targets [rad],
            shape (W, T + COMMANDS - 1, n_motors), or other commands beside them, three or five times as wide.
        motion: Positions [rad] and velocities [rad/s] at the beginning, shape (W, 2, n_motors).
        clock: Time since the episode began, at the beginning [s], shape (W,).
    """

    commands: np.ndarray
    motion: np.ndarray
    clock: np.ndarray

    @property
    def length(self) -> int:
        """Control periods of a window, T."""
        return self.commands.shape[1] - COMMANDS + 1


class Scratch(NamedTuple):
    """What a physics step writes into.

    Attributes:
        pushed: Forces on links.
        torque: Torques [N·m], then the accelerations that they make [rad/s²], shape (n_motors,).
        work: Of `accelerate`, as is the next.
        matrix: Shape (n_motors, n_motors).
        now: Positions [rad] and velocities [rad/s] at one time, shape (2, n_motors).
    """

    pushed: Pushed
    torque: np.ndarray
    work: np.ndarray
    matrix: np.ndarray
    now: np.ndarray


@dataclass(frozen=True)
class Held:
    """A plant in the air, ready for replays.

    Attributes:
        servo: Parameters of the servos.
        tree: The chain of its links.
        pushes: Rows of motor, start, end [s], force [N], point of the motor's link [m]; shape (k, 9).
        bias: Of the logged positions [rad], shape (n_motors,).
        step: Physics period [s].
        period: Control period [s].
        accurate: Whether errors fall with the square of the step; if not, replays are those of Bullet at this step.
    """

    servo: ServoParameters
    tree: Chain
    pushes: np.ndarray
    bias: np.ndarray
    step: float
    period: float
    accurate: bool = False

    @classmethod
    def of(cls, plant: Plant, step: float, period: float, accurate: bool = False) -> Held:
        """Prepare a plant.

        Raises:
            ConfigError: It has a torque hook, which only Bullet calls.
        """
        refuse_hook(plant)
        servo = pack(plant.servo, plant.robot.supply_voltage, plant.law, hardness(plant.robot), plant.robot.sizes)
        pushes = [row for push in plant.pushes for row in _aim(push, plant.robot)]
        tree = chain(plant, plant.servo.armature - servo.rows[ROTOR])
        return cls(servo, tree, np.array(pushes).reshape(-1, 9), plant.sensors.bias, step, period, accurate)

    def replay(self, windows: Windows, load: np.ndarray | None = None) -> np.ndarray:
        """Return what the encoders tell after each control period [rad], shape (W, T, n_motors); NaN if it diverges.

        Args:
            windows: To replay.
            load: What the motors bear besides their servos [N·m], shape (T · substeps, n_motors), in every window.
        """
        measured = np.full((len(windows.clock), windows.length, len(self.bias)), np.nan)
        load = np.zeros((0, len(self.bias))) if load is None else load
        substeps = round(self.period / self.step)
        _replay(self.servo, self.tree, self.pushes, load, windows, self.step, substeps, self.accurate, measured)
        return measured + self.bias

    def play(self, paths: Sequence[np.ndarray], starts: Sequence[np.ndarray], settle: int) -> list[np.ndarray]:
        """Return what the encoders tell before each command and after the last one [rad], (T + 1, n_motors) each.

        Args:
            paths: Motor targets of episodes that are played side by side [rad], shape (T, n_motors) each.
            starts: Positions at rest before them [rad], shape (n_motors,) each.
            settle: Control periods for which the first target is held before an episode begins.
        """
        longest = max(len(path) for path in paths)
        commands = np.array([_around(path, COMMANDS - 1 + settle, longest - len(path))[::-1] for path in paths])
        motion = np.stack([starts, np.zeros_like(starts)], axis=1)
        clock = np.full(len(paths), -settle * self.period)
        measured = self.replay(Windows(np.ascontiguousarray(commands), motion, clock))
        return [replay[settle - 1 : settle + len(path)] for replay, path in zip(measured, paths, strict=True)]


def refuse_hook(plant: Plant) -> None:
    """Refuse a plant that replays in the air would not do justice to.

    Raises:
        ConfigError: It has a torque hook, which only Bullet calls.
    """
    if plant.hook is not None:
        name = getattr(plant.hook, "__qualname__", type(plant.hook).__qualname__)
        problem = f"the torque hook {name} acts in Bullet alone, and logs in the air are replayed without it"
        raise ConfigError("effects", f"{problem}; leave its effect out here, or write it as a law of the servo")


def shares(windows: int, threads: int) -> list[slice]:
    """Return windows in a share for each thread, whole lanes in all but the last."""
    size = -(-windows // (LANES * threads)) * LANES
    return [slice(start, start + size) for start in range(0, windows, size)]


def _around(path: np.ndarray, before: int, after: int) -> np.ndarray:
    """Return a path with its first row repeated before it and its last one after it."""
    return np.concatenate([np.repeat(path[:1], before, axis=0), path, np.repeat(path[-1:], after, axis=0)])


def _aim(push: Push, robot: Robot) -> list[tuple[float, ...]]:
    """Return the row of a push, none if it is at the base, which is held."""
    link, point = carrier(robot, push.link, robot.links[push.link].com)
    motors = [k for k, name in enumerate(robot.motors) if robot.joint(name).child == link]
    return [(k, push.start, push.end, *push.force, *point) for k in motors]


@compile_kernel
def _replay(
    servo: ServoParameters, tree: Chain, pushes: np.ndarray, load: np.ndarray, windows: Windows, step: float,
    substeps: int, accurate: bool, measured: np.ndarray,
) -> None:  # fmt: skip
    for first in range(0, measured.shape[0], LANES):
        _side_by_side(servo, tree, pushes, load, windows, first, step, substeps, accurate, measured)


@compile_kernel
def _side_by_side(
    servo: ServoParameters, tree: Chain, pushes: np.ndarray, load: np.ndarray, windows: Windows, first: int,
    step: float, substeps: int, accurate: bool, measured: np.ndarray,
) -> None:  # fmt: skip
    """Replay as many windows as there are lanes, from the first one on."""
    periods, n = measured.shape[1], measured.shape[2]
    numbers, speaking = zeros_in_lanes(2, n), zeros_in_lanes(2, n)
    motion, encoders = side_by_side(numbers), side_by_side(speaking)
    asked, since = zeros_in_lanes(periods + COMMANDS - 1, windows.commands.shape[2]), zeros_in_lanes(1, 1)
    _fill(windows, first, numbers, asked, since)
    commands, clock, steps = side_by_side(asked), side_by_side(since)[0], np.array([0, 1])
    memory, layers = side_by_side(zeros_in_lanes(MEMORY, n)), side_by_side(zeros_in_lanes(LAYERS, HIDDEN))
    history = side_by_side(zeros_in_lanes(REMEMBERED, 2 * n).reshape((REMEMBERED, 2, n, LANES)))
    settle(memory, history, motion, commands[periods], step)
    pushed = Pushed(pushes[:, 0].astype(np.int64), pushes[:, 6:].copy(), side_by_side(zeros_in_lanes(len(pushes), 3)))
    torque, work = side_by_side(zeros_in_lanes(1, n))[0], side_by_side(zeros_in_lanes(n, COLUMNS))
    matrix = side_by_side(zeros_in_lanes(n, n))
    scratch = Scratch(pushed, torque, work, matrix, side_by_side(zeros_in_lanes(2, n)))
    for t in range(periods):
        state = ServoState(
            commands[periods - 1 - t : periods - 1 - t + COMMANDS], memory, history, clock, steps, layers
        )
        row = load[t * substeps : (t + 1) * substeps]
        if accurate:
            _leap(servo, state, tree, pushes, row, motion, step, substeps, scratch)
        else:
            _step(servo, state, tree, pushes, row, motion, step, substeps, scratch)
        encoder_motion(servo, state, motion, step, encoders)
        if not _note(numbers[1], speaking[0], measured[first : first + LANES], t):
            break
        state.clock[0] += substeps * step


@compile_inner
def _step(
    servo: ServoParameters, state: ServoState, tree: Chain, pushes: np.ndarray, load: np.ndarray, motion: np.ndarray,
    step: float, substeps: int, scratch: Scratch,
) -> None:  # fmt: skip
    """Move on by a control period as Bullet does: velocities by the forces at the beginning of a step, then angles."""
    for k in range(substeps):
        _accelerate(servo, state, tree, pushes, load, motion, k * step, step, k, substeps * step, scratch)
        for i in range(motion.shape[1]):
            motion[1, i] += step * scratch.torque[i]
            motion[0, i] += step * motion[1, i]


@compile_inner
def _leap(
    servo: ServoParameters, state: ServoState, tree: Chain, pushes: np.ndarray, load: np.ndarray, motion: np.ndarray,
    step: float, substeps: int, scratch: Scratch,
) -> None:  # fmt: skip
    """Move on by a control period with velocities half a step ahead of positions (leapfrog, second order).

    Forces see the velocity of their own time, half a step on from the last one. Commands jump between two periods:
    the first and the last half step of a period are of its own command.
    """
    now, torque, n = scratch.now, scratch.torque, motion.shape[1]
    for k in range(substeps + 1):
        inner = 0 < k < substeps
        length, start, ahead = step if inner else 0.5 * step, max(0.0, k - 0.5) * step, 0.5 * step if k > 0 else 0.0
        state.steps[1] = 1 if inner else 2
        for i in range(n):
            now[0, i], now[1, i] = motion[0, i], motion[1, i] + ahead * torque[i]
            if not inner:  # what load friction takes for the speed one (half) step before
                state.memory[SPEED, i] = now[1, i] - length * torque[i]
        _accelerate(
            servo, state, tree, pushes, load, now, start, length, min(k, substeps - 1), substeps * step, scratch
        )
        for i in range(n):
            motion[1, i] += length * torque[i]
            if k < substeps:
                motion[0, i] += step * motion[1, i]
    state.steps[0] -= 1  # the end of a period is the beginning of the next one
    state.steps[1] = 1


@compile_inner
def _accelerate(
    servo: ServoParameters, state: ServoState, tree: Chain, pushes: np.ndarray, load: np.ndarray, motion: np.ndarray,
    start: float, length: float, row: int, period: float, scratch: Scratch,
) -> None:  # fmt: skip
    """Leave the joints' accelerations [rad/s²] in `scratch.torque`, their servos acting for a length of time [s]."""
    servo_torque(servo, state, motion, start, length, period, scratch.torque)
    if len(load) > 0:
        for i in range(motion.shape[1]):
            scratch.torque[i] += load[row, i]
    _push(pushes, state.clock[0] + start, length, scratch.pushed.force)
    accelerate(tree, motion, scratch.pushed, scratch.torque, scratch.work, scratch.matrix)


@compile_inner
def _fill(windows: Windows, first: int, motion: np.ndarray, commands: np.ndarray, clock: np.ndarray) -> None:
    """Write windows into lanes; lanes that are left over get the last window once more."""
    for lane in range(LANES):
        w = min(first + lane, len(windows.clock) - 1)
        clock[0, 0, lane] = windows.clock[w]
        for i in range(motion.shape[1]):
            for k in range(2):
                motion[k, i, lane] = windows.motion[w, k, i]
        for i in range(commands.shape[1]):
            for k in range(len(commands)):
                commands[k, i, lane] = windows.commands[w, k, i]


@compile_inner
def _push(pushes: np.ndarray, time: float, step: float, force: np.ndarray) -> None:
    """Fill in the forces of one physics step."""
    for j in range(len(pushes)):
        share = acting(pushes[j, 1], pushes[j, 2], time, step)
        for k in range(3):
            force[j, k] = share * pushes[j, 3 + k]


@compile_kernel
def _note(speeds: np.ndarray, position: np.ndarray, measured: np.ndarray, t: int) -> bool:
    """Write down the positions of replays that have not run away, now or before, and tell whether there are any."""
    some = False
    for lane in range(len(measured)):
        if (t == 0 or not np.isnan(measured[lane, t - 1, 0])) and np.all(np.abs(speeds[:, lane]) < RUNAWAY):
            measured[lane, t], some = position[:, lane], True
    return some
