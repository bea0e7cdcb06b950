"""The gradient of a replay's cost in the weights of a learned servo law, by a hand-written adjoint.

Windows of a log are replayed as the chain model does, with its rigid-body terms frozen at the measured motion:

    dv/dt = M⁻¹(q measured) tau + free(q, v measured)      tau = servo(q, v, memory; law)

That is exact where the replay is right and keeps the adjoint short: back through one physics step it needs M⁻¹, the
network's own chain rule, and the derivatives of the servo below the law. These are finite differences of the very
kernel that simulates (`output_torque`), joint by joint, so that every named effect may lie below a learned law.
What joints have in common through the supply's voltage counts as given.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsl.core.compiled import compiled
from gsl.core.lanes import LANES, side_by_side, where, zeros_in_lanes
from gsl.core.servo_law import HIDDEN, INPUTS, LAG, LAGS, NOBODY, SIGN, SPEED_UNIT, ServoLaw, act
from gsl.worlds.encoder import REMEMBERED, fill_history
from gsl.worlds.servo import (
    BENT,
    BRISTLE,
    COMMANDS,
    COULOMB,
    DEADBAND,
    DELAY,
    FRICTION,
    KD,
    LAW_BENT,
    LIMIT,
    LOAD,
    MEMORY,
    MOTOR_ENCODER,
    ROTOR,
    ROTOR_ANGLE,
    ROTOR_SPEED,
    SENSOR_DELAY,
    SMOOTHED,
    SPEED,
    STRIBECK,
    THROUGH,
    ServoParameters,
    ServoState,
    delayed,
    drawn_current,
    encoder_motion,
    kept_gain,
    output_torque,
    sensed_error,
    supply_share,
    wanted_torque,
)

SHIFT = 1e-3  # of a delay, in physics steps, for its derivative
LOST = 1e3  # residual of what ran away, in floors
(BY_KP, BY_KD, BY_LIMIT, BY_DELAY, BY_COULOMB, BY_VISCOUS, BY_DEADBAND, BY_ARMATURE, BY_OFFSET) = range(9)
NUMBERS = 9  # kp, kd and limit as logarithms, then [s], [N·m], [N·m·s/rad], [rad], [kg·m²], [rad]
REMEMBERED_ROWS = (BENT, ROTOR_ANGLE, ROTOR_SPEED, SPEED, THROUGH, FRICTION)
PROBES = (1e-7, 1e-5, 1e-5, 1e-8, 1e-8, 1e-5, 1e-5, 1e-4, 1e-4, 1e-5, 1e-5)  # rad, rad/s, N·m, then the rows


class Frozen(NamedTuple):
    """Windows of a log with their rigid-body terms; W windows, T control periods, n motors, of which m are logged.

    Attributes:
        commands: Motor targets, newest first [rad], shape (W, T + COMMANDS - 1, n).
        motion: At the beginning [rad], [rad/s], shape (W, 2, n).
        clock: Time since the episode began, at the beginning [s], shape (W,).
        mobility: Inverse mass matrix in the middle of each period [1/(kg·m²)], shape (W, T, n, n).
        free: Acceleration without torque, there [rad/s²], shape (W, T, n).
        real: Measured after each period [rad], shape (W, T, m).
        floor: Noise floor [rad], shape (m,).
        bias: Of the logged positions [rad], shape (n,).
        warm_up: Periods at the beginning that are not scored.
    """

    commands: np.ndarray
    motion: np.ndarray
    clock: np.ndarray
    mobility: np.ndarray
    free: np.ndarray
    real: np.ndarray
    floor: np.ndarray
    bias: np.ndarray
    warm_up: int


class Gradient(NamedTuple):
    """Derivatives of the cost: by the servo's numbers, in the rows of NUMBERS, and by the fields of its law."""

    numbers: np.ndarray
    lag: np.ndarray
    first: np.ndarray
    first_bias: np.ndarray
    second: np.ndarray
    second_bias: np.ndarray
    last: np.ndarray
    last_bias: np.ndarray


@compiled
def cost_and_gradient(
    servos: ServoParameters, data: Frozen, some: np.ndarray, step: float, substeps: int, robust: float, to: Gradient
) -> float:
    """Return the summed cost of some windows and add its derivatives to `to`; eight windows lie side by side.

    Args:
        servos: With the law.
        data: Windows.
        some: Indices of the windows that are replayed, shape (k,).
        step: Physics period [s].
        substeps: Physics steps in a control period.
        robust: Residual [floors] beyond which a residual counts less and less (Cauchy).
        to: Derivatives, added to; a window that runs away has a cost and no derivatives.
    """
    total = 0.0
    for first in range(0, len(some), LANES):
        total += _side_by_side(servos, data, some[first : first + LANES], step, substeps, robust, to)
    return total


@compiled
def _cube(a: int, b: int, c: int) -> np.ndarray:
    return zeros_in_lanes(a, b * c).reshape((a, b, c, LANES))


@compiled
def _side_by_side(
    servos: ServoParameters, data: Frozen, some: np.ndarray, step: float, substeps: int, robust: float, to: Gradient
) -> float:
    periods, n, m = data.free.shape[1], data.free.shape[2], data.real.shape[2]
    steps, groups = periods * substeps, len(to.last_bias)
    numbers = zeros_in_lanes(steps + 1, 2 * n).reshape((steps + 1, 2, n, LANES))
    motions, memories = side_by_side(numbers), side_by_side(_cube(steps + 1, MEMORY, n))
    errors, positions = side_by_side(zeros_in_lanes(steps, n)), side_by_side(zeros_in_lanes(steps, n))
    wanted, outputs = side_by_side(zeros_in_lanes(steps, n)), side_by_side(zeros_in_lanes(steps, n))
    speeds = side_by_side(zeros_in_lanes(steps, n))  # as the servos saw them
    scores = zeros_in_lanes(periods, m)
    asked, since, body = zeros_in_lanes(periods + COMMANDS - 1, n), zeros_in_lanes(1, 1), zeros_in_lanes(periods, n)
    matrices = zeros_in_lanes(periods, n * n).reshape((periods, n, n, LANES))
    _fill(data, some, numbers[0], asked, since, body, matrices)
    state = ServoState(
        side_by_side(asked), side_by_side(zeros_in_lanes(MEMORY, n)), side_by_side(_cube(REMEMBERED, 2, n)),
        side_by_side(since)[0],
        np.zeros(1, dtype=np.int64), side_by_side(zeros_in_lanes(3, HIDDEN)),
    )  # fmt: skip
    _settle(state, motions[0], state.commands[periods], step)
    rigid = side_by_side(matrices), side_by_side(body)
    speaking = zeros_in_lanes(2, n)
    _forward(
        servos,
        state,
        rigid,
        step,
        substeps,
        speaking,
        side_by_side(speaking),
        motions,
        memories,
        errors,
        positions,
        speeds,
        wanted,
        outputs,
        data,
        some,
        robust,
        scores,
    )  # noqa: E501
    cost = _score(data, some, robust, scores)
    sums = (
        zeros_in_lanes(NUMBERS, n), zeros_in_lanes(n, LAGS), zeros_in_lanes(groups, INPUTS * HIDDEN), zeros_in_lanes(groups, HIDDEN),
        zeros_in_lanes(groups, HIDDEN * HIDDEN), zeros_in_lanes(groups, HIDDEN), zeros_in_lanes(groups, HIDDEN * 2),
        zeros_in_lanes(groups, 2),
    )  # fmt: skip
    by = Gradient(
        side_by_side(sums[0]), side_by_side(sums[1]), side_by_side(sums[2].reshape((groups, INPUTS, HIDDEN, LANES))),
        side_by_side(sums[3]), side_by_side(sums[4].reshape((groups, HIDDEN, HIDDEN, LANES))), side_by_side(sums[5]),
        side_by_side(sums[6].reshape((groups, HIDDEN, 2, LANES))), side_by_side(sums[7]),
    )  # fmt: skip
    _backward(
        servos,
        state,
        rigid,
        since,
        data,
        some,
        step,
        substeps,
        motions,
        memories,
        errors,
        positions,
        speeds,
        wanted,
        outputs,
        side_by_side(scores),
        by,
    )  # noqa: E501
    for lane in range(len(some)):
        if _finite(sums, lane):
            _add(to, sums, lane)
    return cost


@compiled
def _finite(sums: tuple[np.ndarray, ...], lane: int) -> bool:
    return (
        np.isfinite(sums[0][:, :, lane]).all()
        and np.isfinite(sums[2][:, :, lane]).all()
        and np.isfinite(sums[7][:, :, lane]).all()
    )


@compiled
def _add(to: Gradient, sums: tuple[np.ndarray, ...], lane: int) -> None:
    """Add a lane's derivatives."""
    groups = len(to.last_bias)
    to.numbers[:] += sums[0][:, :, lane]
    to.lag[:] += sums[1][:, :, lane]
    to.first[:] += sums[2][:, :, lane].copy().reshape((groups, INPUTS, HIDDEN))
    to.first_bias[:] += sums[3][:, :, lane]
    to.second[:] += sums[4][:, :, lane].copy().reshape((groups, HIDDEN, HIDDEN))
    to.second_bias[:] += sums[5][:, :, lane]
    to.last[:] += sums[6][:, :, lane].copy().reshape((groups, HIDDEN, 2))
    to.last_bias[:] += sums[7][:, :, lane]


@compiled
def _fill(
    data: Frozen, some: np.ndarray, motion: np.ndarray, commands: np.ndarray, clock: np.ndarray, body: np.ndarray,
    matrices: np.ndarray,
) -> None:  # fmt: skip
    """Write windows into lanes; lanes that are left over get the last window once more."""
    for lane in range(LANES):
        w = some[min(lane, len(some) - 1)]
        clock[0, 0, lane] = data.clock[w]
        motion[:, :, lane], commands[:, :, lane] = data.motion[w], data.commands[w]
        body[:, :, lane], matrices[:, :, :, lane] = data.free[w], data.mobility[w]


@compiled
def _settle(state: ServoState, motion: np.ndarray, target: np.ndarray, step: float) -> None:
    """Fill in the state of settled servos, as a replay begins with."""
    for i in range(motion.shape[1]):
        state.memory[ROTOR_ANGLE, i], state.memory[ROTOR_SPEED, i] = motion[0, i], motion[1, i]
        state.memory[SPEED, i], state.memory[SMOOTHED, i] = motion[1, i], target[i]
    fill_history(state.history, motion, step)


@compiled
def _score(data: Frozen, some: np.ndarray, robust: float, scores: np.ndarray) -> float:
    """Return the cost of residuals [floors], and write its derivatives by the positions [1/rad] in their place."""
    cost = 0.0
    for lane in range(LANES):
        for t in range(data.warm_up, len(scores)):
            for i in range(scores.shape[1]):
                z = scores[t, i, lane]
                if not abs(z) < LOST:
                    z = LOST
                if lane < len(some):
                    cost += robust * robust * np.log1p((z / robust) ** 2)
                scores[t, i, lane] = 2.0 * z / (1.0 + (z / robust) ** 2) / data.floor[i]
    return cost


@compiled
def _forward(
    servos: ServoParameters, start: ServoState, rigid: tuple[np.ndarray, np.ndarray], step: float, substeps: int,
    speaking: np.ndarray, told: np.ndarray, motions: np.ndarray, memories: np.ndarray, errors: np.ndarray,
    positions: np.ndarray, speeds: np.ndarray, wanted: np.ndarray, outputs: np.ndarray, data: Frozen, some: np.ndarray, robust: float,
    scores: np.ndarray,
) -> None:  # fmt: skip
    """Replay; fill in the paths and, in `scores`, the residuals [floors] after each period, shape (T, m, LANES)."""
    rows, (periods, n), period = servos.rows, data.free.shape[1:], substeps * step
    torque, memory = side_by_side(zeros_in_lanes(1, n))[0], start.memory
    for t in range(periods):
        commands = start.commands[periods - 1 - t : periods - 1 - t + COMMANDS]
        state = ServoState(commands, memory, start.history, start.clock, start.steps, start.layers)
        for k in range(substeps):
            s = t * substeps + k
            motion = motions[s]
            for r in range(MEMORY):
                for i in range(n):
                    memories[s, r, i] = memory[r, i]
            current = drawn_current(rows, memory)
            for i in range(n):
                error, q, v = sensed_error(rows, state, i, motion, k * step, step, period)
                u, output = wanted_torque(servos, state, i, motion, error, q, v, k * step, step, period)
                errors[s, i], positions[s, i], speeds[s, i] = error, q, v
                wanted[s, i], outputs[s, i] = u, output
                supply = supply_share(rows, i, current)
                torque[i] = output_torque(rows, memory, i, motion, u, output, supply, step)
            state.steps[0] += 1
            for i in range(n):
                a = rigid[1][t, i]
                for j in range(n):
                    a += rigid[0][t, i, j] * torque[j]
                motions[s + 1, 1, i] = motion[1, i] + step * a
                motions[s + 1, 0, i] = motion[0, i] + step * motions[s + 1, 1, i]
        encoder_motion(servos, state, motions[(t + 1) * substeps], step, told)
        state.clock[0] += period
        if t >= data.warm_up:
            for lane in range(LANES):
                w = some[min(lane, len(some) - 1)]
                for i in range(scores.shape[1]):
                    off = speaking[0, i, lane] + data.bias[i] - data.real[w, t, i]
                    scores[t, i, lane] = off / data.floor[i]


@compiled
def _backward(
    servos: ServoParameters, start: ServoState, rigid: tuple[np.ndarray, np.ndarray], since: np.ndarray, data: Frozen,
    some: np.ndarray, step: float, substeps: int, motions: np.ndarray, memories: np.ndarray, errors: np.ndarray,
    positions: np.ndarray, speeds: np.ndarray, wanted: np.ndarray, outputs: np.ndarray, slopes: np.ndarray, to: Gradient,
) -> None:  # fmt: skip
    rows, law, (periods, n) = servos.rows.copy(), servos.law, data.free.shape[1:]
    m, period, steps = data.real.shape[2], substeps * step, periods * substeps
    sensed = side_by_side(_cube(steps + 2, 2, n))  # adjoints of what the encoders saw at each step
    moved, held = side_by_side(zeros_in_lanes(2, n)), side_by_side(zeros_in_lanes(MEMORY, n))  # of the step's outcome
    push, jacobian = side_by_side(zeros_in_lanes(1, n))[0], side_by_side(zeros_in_lanes(11, 7))
    scratch, inner = side_by_side(zeros_in_lanes(MEMORY, n)), side_by_side(zeros_in_lanes(1, HIDDEN))
    hidden = side_by_side(zeros_in_lanes(2, HIDDEN))
    for s in range(steps - 1, -1, -1):
        t, k = s // substeps, s % substeps
        motion = motions[s]
        commands = start.commands[periods - 1 - t : periods - 1 - t + COMMANDS]
        state = ServoState(commands, start.memory, start.history, start.clock, start.steps, start.layers)
        if k == substeps - 1:
            for lane in range(LANES):
                since[0, 0, lane] = data.clock[some[min(lane, len(some) - 1)]] + t * period
            for i in range(m):
                _spread(rows, i, s + 1, slopes[t, i], 0, step, sensed)
        for i in range(n):
            _take_sensed(rows, i, s + 1, sensed, moved, held)
        for i in range(n):
            moved[1, i] += step * moved[0, i]
        for j in range(n):
            push[j] = 0.0
        for i in range(n):
            for j in range(n):
                push[j] += step * rigid[0][t, i, j] * moved[1, i]
        current = drawn_current(rows, memories[s])
        for i in range(n):
            supply = supply_share(rows, i, current)
            _differentiate(rows, memories[s], i, motion, wanted[s, i], outputs[s, i], supply, step, scratch, jacobian)
            by_limit, by_coulomb = _by_rows(i, push[i], jacobian, held)
            by_u, by_out = _servo_back(i, push[i], jacobian, moved, held)
            gain, error = kept_gain(rows, state, i, k * step), errors[s, i]
            by_error = where(abs(error) > rows[DEADBAND, i], gain * by_u, 0.0)
            by_v = -rows[KD, i] * by_u
            kept = error - min(rows[DEADBAND, i], max(-rows[DEADBAND, i], error))
            to.numbers[BY_KP, i] += by_u * gain * kept
            to.numbers[BY_KD, i] += by_v * speeds[s, i]
            to.numbers[BY_DEADBAND, i] -= where(error > 0.0, by_error, -by_error)
            to.numbers[BY_LIMIT, i] += by_limit * rows[LIMIT, i]
            to.numbers[BY_COULOMB, i] += by_coulomb
            to.numbers[BY_VISCOUS, i] -= by_out * motion[1, i]
            to.numbers[BY_ARMATURE, i] -= push[i] * (motions[s + 1, 1, i] - motion[1, i]) / step
            later = _later(state.commands, i, (k * step - rows[DELAY, i]) / period, step / period) / period
            to.numbers[BY_DELAY, i] += by_error * later
            if law.group[i] != NOBODY:
                state.memory[LAW_BENT, i] = memories[s, LAW_BENT, i]
                wanted_torque(servos, state, i, motion, 0.0 * by_u, positions[s, i], 0.0 * by_u, k * step, step, period)
                by_error += _law_back(law, i, by_u, by_out, state.layers, inner, hidden, to)
                for lag in range(LAGS):
                    begun = (k * step - rows[DELAY, i] - LAG * lag) / period
                    later = _later(state.commands, i, begun, step / period) / period
                    share = inner[0, lag] + law.torque[i] * by_u * law.lag[i, lag]
                    to.numbers[BY_DELAY, i] += law.stiffness[i] * share * later
                moved[1, i] += inner[0, LAGS] / SPEED_UNIT
                moved[1, i] += inner[0, LAGS + 1] * SIGN * _slope(SIGN * motion[1, i])
                before = memories[s, LAW_BENT, i] + step * motion[1, i]
                bent = inner[0, LAGS + 2] / BRISTLE + held[LAW_BENT, i]
                held[LAW_BENT, i] = where(abs(before) < BRISTLE, bent, 0.0)
                moved[1, i] += step * held[LAW_BENT, i]
            to.numbers[BY_OFFSET, i] += by_error
            _spread(rows, i, s, -by_error, 0, step, sensed)
            _spread(rows, i, s, by_v, 1, step, sensed)


@compiled
def _later(commands: np.ndarray, i: int, start: float, length: float) -> float:
    """Return the derivative of a delayed target by its delay [rad per control period]."""
    return (delayed(commands, i, start - SHIFT * length, length) - delayed(commands, i, start, length)) / (
        SHIFT * length
    )


@compiled
def _spread(rows: np.ndarray, i: int, s: int, share: float, row: int, step: float, sensed: np.ndarray) -> None:
    """Give the adjoint of what an encoder tells at step s to the steps at which it was measured."""
    age = rows[SENSOR_DELAY, i] / step
    first = s - int(age)
    older = age - int(age)
    if first >= 0:
        sensed[first, row, i] += (1.0 - older) * share
    if first >= 1 and older > 0.0:
        sensed[first - 1, row, i] += older * share


@compiled
def _take_sensed(rows: np.ndarray, i: int, s: int, sensed: np.ndarray, moved: np.ndarray, held: np.ndarray) -> None:
    """Pass the adjoint of what was measured at step s to the output's motion, or to the rotor's."""
    if rows[MOTOR_ENCODER, i] * rows[ROTOR, i] > 0.0:
        held[ROTOR_ANGLE, i] += sensed[s, 0, i]
        held[ROTOR_SPEED, i] += sensed[s, 1, i]
    else:
        moved[0, i] += sensed[s, 0, i]
        moved[1, i] += sensed[s, 1, i]


@compiled
def _differentiate(
    rows: np.ndarray, memory: np.ndarray, i: int, motion: np.ndarray, u: float, output: float, supply: float,
    step: float, scratch: np.ndarray, jacobian: np.ndarray,
) -> None:  # fmt: skip
    """Fill in derivatives of (torque, remembered rows), shape (11, 7).

    By position, speed, u, the remembered rows, the torque limit and the dry friction.
    """
    dry = rows[COULOMB, i] > 0.0 or rows[STRIBECK, i] > 0.0 or rows[LOAD, i] > 0.0
    matters = (
        True, True, True, dry, rows[ROTOR, i] > 0.0, rows[ROTOR, i] > 0.0, rows[LOAD, i] > 0.0, rows[LOAD, i] > 0.0,
        rows[LOAD, i] > 0.0, True, rows[COULOMB, i] > 0.0,
    )  # fmt: skip
    base = _outcome(rows, memory, i, motion, u, output, supply, step, scratch, -1)
    for k in range(11):
        if not matters[k]:
            for r in range(7):
                jacobian[k, r] = 0.0
            continue
        probe = _outcome(rows, memory, i, motion, u, output, supply, step, scratch, k)
        for r in range(7):
            jacobian[k, r] = (probe[r] - base[r]) / PROBES[k]


@compiled
def _outcome(
    rows: np.ndarray, memory: np.ndarray, i: int, motion: np.ndarray, u: float, output: float, supply: float,
    step: float, scratch: np.ndarray, probed: int,
) -> tuple[float, float, float, float, float, float, float]:  # fmt: skip
    """Return torque and remembered rows after a step, one of the inputs being moved by its probe."""
    for r in range(MEMORY):
        scratch[r, i] = memory[r, i]
    if 3 <= probed < 9:
        scratch[REMEMBERED_ROWS[probed - 3], i] += PROBES[probed]
    wanted, q, v = u, motion[0, i], motion[1, i]
    if probed == 2:
        wanted += PROBES[2]
    elif probed == 0 or probed == 1:
        motion[probed, i] += PROBES[probed]
    limit, coulomb = rows[LIMIT, i], rows[COULOMB, i]
    rows[LIMIT, i] += PROBES[9] if probed == 9 else 0.0
    rows[COULOMB, i] += PROBES[10] if probed == 10 else 0.0
    torque = output_torque(rows, scratch, i, motion, wanted, output, supply, step)
    motion[0, i], motion[1, i], rows[LIMIT, i], rows[COULOMB, i] = q, v, limit, coulomb
    return (
        torque, scratch[BENT, i], scratch[ROTOR_ANGLE, i], scratch[ROTOR_SPEED, i], scratch[SPEED, i],
        scratch[THROUGH, i], scratch[FRICTION, i],
    )  # fmt: skip


@compiled
def _by_rows(i: int, push: float, jacobian: np.ndarray, held: np.ndarray) -> tuple[float, float]:
    """Return the adjoints of motor i's torque limit and dry friction."""
    by_limit, by_coulomb = push * jacobian[9, 0], push * jacobian[10, 0]
    for r in range(6):
        by_limit += held[REMEMBERED_ROWS[r], i] * jacobian[9, r + 1]
        by_coulomb += held[REMEMBERED_ROWS[r], i] * jacobian[10, r + 1]
    return by_limit, by_coulomb


@compiled
def _servo_back(i: int, push: float, jacobian: np.ndarray, moved: np.ndarray, held: np.ndarray) -> tuple[float, float]:
    """Pull adjoints back through motor i's output; return those of u and of what the law adds behind the limit."""
    by_out = push - held[FRICTION, i]
    after = (
        push, held[BENT, i], held[ROTOR_ANGLE, i], held[ROTOR_SPEED, i], held[SPEED, i], held[THROUGH, i],
        held[FRICTION, i],
    )  # fmt: skip
    by_u = 0.0 * push
    for k in range(9):
        share = 0.0 * push
        for r in range(7):
            share += jacobian[k, r] * after[r]
        if k < 2:
            moved[k, i] += share
        elif k == 2:
            by_u = share
        else:
            held[REMEMBERED_ROWS[k - 3], i] = share
    return by_u, by_out


@compiled
def _law_back(
    law: ServoLaw, i: int, by_u: float, by_out: float, layers: np.ndarray, inner: np.ndarray, hidden: np.ndarray,
    to: Gradient,
) -> float:  # fmt: skip
    """Pull adjoints back through motor i's law, add to the gradient, and return the adjoint of the control error.

    Args:
        law: Of all motors.
        i: Motor.
        by_u: Adjoint of its torque before the limit.
        by_out: Adjoint of its torque behind it.
        layers: What it saw and its hidden layers before activation, shape (3, HIDDEN).
        inner: Result, row 0: adjoints of its inputs, shape (1, HIDDEN).
        hidden: Scratch, shape (2, HIDDEN).
        to: Added to.
    """
    g, drive, output = law.group[i], law.torque[i] * by_u, law.torque[i] * by_out
    to.last_bias[g, 0] += drive
    to.last_bias[g, 1] += output
    for h in range(HIDDEN):
        x = act(layers[2, h])
        to.last[g, h, 0] += drive * x
        to.last[g, h, 1] += output * x
        hidden[1, h] = _slope(layers[2, h]) * (law.last[g, h, 0] * drive + law.last[g, h, 1] * output)
        to.second_bias[g, h] += hidden[1, h]
    for k in range(HIDDEN):
        x, back = act(layers[1, k]), 0.0 * drive
        for h in range(HIDDEN):
            to.second[g, k, h] += x * hidden[1, h]
            back += law.second[g, k, h] * hidden[1, h]
        hidden[0, k] = _slope(layers[1, k]) * back
        to.first_bias[g, k] += hidden[0, k]
    by_error = 0.0 * drive
    for k in range(INPUTS):
        x, back = layers[0, k], 0.0 * drive
        for h in range(HIDDEN):
            to.first[g, k, h] += x * hidden[0, h]
            back += law.first[g, k, h] * hidden[0, h]
        if k < LAGS:
            to.lag[i, k] += drive * x
            by_error += law.stiffness[i] * (back + drive * law.lag[i, k])
        inner[0, k] = back
    return by_error


@compiled
def _slope(z: float) -> float:
    """Return the derivative of `act`."""
    low = 27.0 + 9.0 * z * z
    inside = (27.0 + 3.0 * z * z) / low - 18.0 * z * z * (27.0 + z * z) / (low * low)
    return where(abs(z) < 3.0, inside, 0.0)
