"""Replays of servos through frozen rigid-body terms, eight windows side by side, and the path that they leave."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsl.core.compiled import compile_inner, compile_kernel
from gsl.core.lanes import LANES, side_by_side, zeros_in_lanes
from gsl.training.frozen import Frozen
from gsl.worlds.servo import (
    compute_current,
    compute_wanted_torque,
    encoder_motion,
    output_torque,
    sense_error,
    supply_share,
)
from gsl.worlds.servo_state import COMMANDS, MEMORY, ServoParameters, ServoState, settle

ERROR, POSITION, RATE, WANTED, OUTPUT = range(5)  # rows of what a servo saw and did
ROWS = 5  # how many these are
LOST = 1e3  # residual beyond which a replay has run away [floors]


class Loaded(NamedTuple):
    """Windows as floats with an axis of lanes in the end; see `Frozen` for shapes before it, without W."""

    commands: np.ndarray
    motion: np.ndarray
    clock: np.ndarray
    mobility: np.ndarray
    free: np.ndarray


class Path(NamedTuple):
    """Eight windows in lanes, T control periods and S physics steps long, for n motors.

    Attributes:
        state: Of the servos; its commands are those of the whole window, shape (T + COMMANDS - 1, n) or (..., 3 n).
        begin: Clock at the beginning [s], shape (1,).
        mobility, free: See `Frozen`, shapes (T, n, n) and (T, n).
        motion: Positions [rad] and velocities [rad/s] before each physics step and after the last one, (S + 1, 2, n).
        memory: Of the servos before each physics step, shape (S, MEMORY, n).
        seen: Control error [rad], position [rad] and velocity [rad/s] as the servo saw them, wanted torque and what the
            law adds at the output [N·m], in each physics step, shape (S, ROWS, n).
        encoders: Positions [rad] and velocities [rad/s] that the encoders tell after each period, shape (T, 2, n).
    """

    state: ServoState
    begin: np.ndarray
    mobility: np.ndarray
    free: np.ndarray
    motion: np.ndarray
    memory: np.ndarray
    seen: np.ndarray
    encoders: np.ndarray


class Moment(NamedTuple):
    """A physics step; its arrays are parts of a path.

    Attributes:
        number: Of the step in the window.
        elapsed: Time since the newest command was issued [s].
        step: Physics period [s].
        period: Control period [s].
        motion, after: Of the outputs before and after it [rad], [rad/s], shape (2, n).
        memory: Of the servos before it, shape (MEMORY, n).
        seen: See `Path`, shape (ROWS, n).
    """

    number: int
    elapsed: float
    step: float
    period: float
    motion: np.ndarray
    after: np.ndarray
    memory: np.ndarray
    seen: np.ndarray


@compile_kernel
def cube(first: int, second: int, third: int) -> np.ndarray:
    """Return zeros for `side_by_side`, shape (first, second, third, LANES)."""
    return zeros_in_lanes(first, second * third).reshape((first, second, third, LANES))


@compile_kernel
def load(data: Frozen, some: np.ndarray) -> Loaded:
    """Return windows in lanes; lanes that are left over get the last window once more."""
    (periods, n), (ticks, columns) = data.free.shape[1:], data.commands.shape[1:]
    into = Loaded(
        zeros_in_lanes(ticks, columns), zeros_in_lanes(2, n), zeros_in_lanes(1, 1),
        cube(periods, n, n), zeros_in_lanes(periods, n),
    )  # fmt: skip
    for lane in range(LANES):
        w = some[min(lane, len(some) - 1)]
        into.clock[0, 0, lane] = data.clock[w]
        into.motion[:, :, lane], into.commands[:, :, lane] = data.motion[w], data.commands[w]
        into.free[:, :, lane], into.mobility[:, :, :, lane] = data.free[w], data.mobility[w]
    return into


@compile_kernel
def replay(servos: ServoParameters, path: Path, start: np.ndarray, step: float, substeps: int) -> None:
    """Fill in a path.

    Args:
        servos: With the law.
        path: Its state, commands apart, is zero in the beginning.
        start: Positions [rad] and velocities [rad/s] at the beginning, in lanes, shape (2, n).
        step: Physics period [s].
        substeps: Physics steps in a control period.
    """
    (periods, n), period, whole = path.free.shape, substeps * step, path.state
    torque = side_by_side(zeros_in_lanes(1, n))[0]
    settle(whole.memory, whole.history, start, whole.commands[periods], step)
    whole.clock[0] = path.begin[0]
    for k in range(2):
        for i in range(n):
            path.motion[0, k, i] = start[k, i]
    for t in range(periods):
        commands = whole.commands[periods - 1 - t : periods - 1 - t + COMMANDS]
        state = ServoState(commands, whole.memory, whole.history, whole.clock, whole.steps, whole.layers)
        for k in range(substeps):
            s = t * substeps + k
            motion, after, memory, seen = path.motion[s], path.motion[s + 1], path.memory[s], path.seen[s]
            now = Moment(s, k * step, step, period, motion, after, memory, seen)
            _torque(servos, state, now, torque)
            _move(path.mobility[t], path.free[t], torque, now)
        encoder_motion(servos, state, path.motion[(t + 1) * substeps], step, path.encoders[t])
        state.clock[0] += period


@compile_inner
def _torque(servos: ServoParameters, state: ServoState, now: Moment, torque: np.ndarray) -> None:
    """Do as `servo.servo_torque` does, and write down what the servos saw and did."""
    rows, memory, motion, seen = servos.rows, state.memory, now.motion, now.seen
    elapsed, step, period = now.elapsed, now.step, now.period
    for r in range(MEMORY):
        for i in range(motion.shape[1]):
            now.memory[r, i] = memory[r, i]
    current = compute_current(rows, memory)
    for i in range(motion.shape[1]):
        error, q, v = sense_error(rows, state, i, motion, elapsed, step, period)
        u, output = compute_wanted_torque(servos, state, i, motion, error, q, v, elapsed, step, period)
        seen[ERROR, i], seen[POSITION, i], seen[RATE, i] = error, q, v
        seen[WANTED, i], seen[OUTPUT, i] = u, output
        torque[i] = output_torque(rows, memory, i, motion, u, output, supply_share(rows, i, current), step)
    state.steps[0] += 1


@compile_inner
def _move(mobility: np.ndarray, free: np.ndarray, torque: np.ndarray, now: Moment) -> None:
    """Step the links, semi-implicitly as the chain model does."""
    motion, after, step = now.motion, now.after, now.step
    for i in range(len(torque)):
        a = free[i]
        for j in range(len(torque)):
            a += mobility[i, j] * torque[j]
        after[1, i] = motion[1, i] + step * a
        after[0, i] = motion[0, i] + step * after[1, i]


@compile_kernel
def score(data: Frozen, some: np.ndarray, robust: float, measured: np.ndarray, slopes: np.ndarray) -> float:
    """Return the cost of replayed windows.

    Args:
        data: The windows.
        some: Indices of those that were replayed, at most LANES.
        robust: Residual beyond which one counts less and less (Cauchy) [floors].
        measured: Of `Path`, as floats, shape (T, 2, n, LANES).
        slopes: Result, derivatives by the measured positions [1/rad], shape (T, m, LANES); zero where a replay is lost.
    """
    cost = 0.0
    for lane in range(LANES):
        w = some[min(lane, len(some) - 1)]
        for t in range(data.warm_up, len(slopes)):
            for i in range(slopes.shape[1]):
                z = (measured[t, 0, i, lane] + data.bias[i] - data.real[w, t, i]) / data.floor[i]
                lost = not abs(z) < LOST
                z = LOST if lost else z
                if lane < len(some):
                    cost += robust * robust * np.log1p((z / robust) ** 2)
                slopes[t, i, lane] = 0.0 if lost else 2.0 * z / (1.0 + (z / robust) ** 2) / data.floor[i]
    return cost
