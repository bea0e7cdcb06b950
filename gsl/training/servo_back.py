"""Adjoints back through the servo below the law: its output, its feedback, its target, its encoder.

The output's derivatives are finite differences of the very kernel that simulates, joint by joint, so that every named
effect may lie below a learned law. What joints have in common through the supply's voltage counts as given.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gsl.core.compiled import compile_inner
from gsl.core.lanes import where
from gsl.core.servo import ROW
from gsl.training.gradient import (
    BY_ARMATURE,
    BY_COULOMB,
    BY_DEADBAND,
    BY_DELAY,
    BY_KD,
    BY_KP,
    BY_LIMIT,
    BY_VISCOUS,
)
from gsl.training.replay_path import ERROR, OUTPUT, RATE, WANTED, Moment
from gsl.worlds.drive_train import ROTOR_SHARE
from gsl.worlds.servo import (
    BESIDE,
    command_beside,
    compute_current,
    compute_gain,
    delay_command,
    gain_shares,
    output_torque,
    supply_share,
)
from gsl.worlds.servo_state import (
    BENT,
    FRICTION,
    MEMORY,
    OUTPUT_ARMATURE,
    ROTOR,
    ROTOR_ANGLE,
    ROTOR_SPEED,
    SMOOTHED,
    SPEED,
    THROUGH,
    ServoState,
)

SHIFT = 1e-3  # of a delay, in physics steps, for its derivative
REMEMBERED_ROWS = (BENT, ROTOR_ANGLE, ROTOR_SPEED, SPEED, THROUGH, FRICTION)
OUTCOMES = 7  # the torque and these rows
FIRST_ROW, BY_ROW_LIMIT, BY_ROW_COULOMB, BY_ROW_ARMATURE, PROBED = 3, 9, 10, 11, 12
PROBES = (1e-7, 1e-5, 1e-5, 1e-8, 1e-8, 1e-5, 1e-5, 1e-4, 1e-4, 1e-5, 1e-5, 1e-7)
"""Sizes of the differences: q [rad], v [rad/s], u [N·m], the remembered rows, limit, Coulomb [N·m], rotor [kg·m²]."""


class Adjoint(NamedTuple):
    """Derivatives of the cost by what the servos are around a physics step, in lanes; n motors, S steps in all.

    Attributes:
        moved: By positions and velocities of the outputs, shape (2, n).
        held: By the memory of the servos, shape (MEMORY, n).
        sensed: By what the encoders measured at each physics step, shape (S + 1, 2, n).
        push: By the torques of the step, shape (n,).
        wanted: By the torques before the limit, shape (n,).
        output: By what the law adds behind it, shape (n,).
        error: By the control errors, shape (n,).
    """

    moved: np.ndarray
    held: np.ndarray
    sensed: np.ndarray
    push: np.ndarray
    wanted: np.ndarray
    output: np.ndarray
    error: np.ndarray


class Work(NamedTuple):
    """Scratch, in lanes.

    Attributes:
        jacobian: Derivatives of a motor's outcomes by what is probed, shape (PROBED, OUTCOMES).
        memory: Shape (MEMORY, n).
        inputs: Derivatives by the inputs of a motor's law, shape (HIDDEN,).
        hidden: By its hidden layers, shape (2, HIDDEN).
    """

    jacobian: np.ndarray
    memory: np.ndarray
    inputs: np.ndarray
    hidden: np.ndarray


@compile_inner
def output_back(rows: np.ndarray, now: Moment, adjoint: Adjoint, work: Work, numbers: np.ndarray) -> None:
    """Pull adjoints back through the servos' outputs, to those of wanted torque and of what the law adds behind it.

    Motors are looped over in here, not outside: bundles of arrays cost more to pass on than some motors to compute.

    Args:
        rows: Of `ServoParameters`, a copy that is changed in between.
        now: Physics step.
        adjoint: Of the step's outcome; becomes that of what it began with.
        work: Scratch.
        numbers: Of `Gradient`, added to.
    """
    motion, after, memory, seen, step = now.motion, now.after, now.memory, now.seen, now.step
    held, jacobian, current = adjoint.held, work.jacobian, compute_current(rows, memory)
    for i in range(motion.shape[1]):
        push, supply = adjoint.push[i], supply_share(rows, i, current)
        outcome = (
            push, held[BENT, i], held[ROTOR_ANGLE, i], held[ROTOR_SPEED, i], held[SPEED, i], held[THROUGH, i],
            held[FRICTION, i],
        )  # fmt: skip
        _differentiate(rows, i, motion, memory, seen, supply, step, work.memory, jacobian)
        adjoint.output[i] = push - held[FRICTION, i]
        adjoint.wanted[i] = _sum(jacobian, 2, outcome)
        for k in range(2):
            adjoint.moved[k, i] += _sum(jacobian, k, outcome)
        for k in range(FIRST_ROW, BY_ROW_LIMIT):
            held[REMEMBERED_ROWS[k - FIRST_ROW], i] = _sum(jacobian, k, outcome)
        numbers[BY_LIMIT, i] += rows[ROW.limit, i] * _sum(jacobian, BY_ROW_LIMIT, outcome)
        numbers[BY_COULOMB, i] += _sum(jacobian, BY_ROW_COULOMB, outcome)
        numbers[BY_VISCOUS, i] -= adjoint.output[i] * motion[1, i]
        carried = 1.0 - ROTOR_SHARE if rows[ROTOR, i] > 0.0 else 1.0
        numbers[BY_ARMATURE, i] += _sum(jacobian, BY_ROW_ARMATURE, outcome)
        numbers[BY_ARMATURE, i] -= carried * push * (after[1, i] - motion[1, i]) / step


@compile_inner
def _sum(jacobian: np.ndarray, k: int, outcome: tuple[float, ...]) -> float:
    total = 0.0 * outcome[0]
    for r in range(OUTCOMES):
        total += jacobian[k, r] * outcome[r]
    return total


@compile_inner
def _differentiate(
    rows: np.ndarray, i: int, motion: np.ndarray, before: np.ndarray, seen: np.ndarray, supply: float, step: float,
    memory: np.ndarray, jacobian: np.ndarray,
) -> None:  # fmt: skip
    """Fill in the derivatives of torque and remembered rows, zero where nothing depends on what would be probed."""
    load, rotor = rows[ROW.load_friction, i] > 0.0, rows[ROTOR, i] > 0.0
    dry = rows[ROW.coulomb, i] > 0.0 or rows[ROW.stribeck, i] > 0.0 or load
    matters = (True, True, True, dry, rotor, rotor, load, load, load, True, dry, load or rotor)
    base = _outcome(rows, i, motion, before, seen, supply, step, memory, -1)
    for k in range(PROBED):
        if not matters[k]:
            for r in range(OUTCOMES):
                jacobian[k, r] = 0.0
            continue
        probe = _outcome(rows, i, motion, before, seen, supply, step, memory, k)
        for r in range(OUTCOMES):
            jacobian[k, r] = (probe[r] - base[r]) / PROBES[k]


@compile_inner
def _outcome(
    rows: np.ndarray, i: int, motion: np.ndarray, before: np.ndarray, seen: np.ndarray, supply: float, step: float,
    memory: np.ndarray, probed: int,
) -> tuple[float, float, float, float, float, float, float]:  # fmt: skip
    """Return torque and remembered rows after a step, what is probed being moved by its probe."""
    for r in range(MEMORY):
        memory[r, i] = before[r, i]
    if FIRST_ROW <= probed < BY_ROW_LIMIT:
        memory[REMEMBERED_ROWS[probed - FIRST_ROW], i] += PROBES[probed]
    wanted, q, v = seen[WANTED, i], motion[0, i], motion[1, i]
    if probed == 2:
        wanted += PROBES[2]
    elif probed == 0 or probed == 1:
        motion[probed, i] += PROBES[probed]
    limit, coulomb, carried, rotor = rows[ROW.limit, i], rows[ROW.coulomb, i], rows[OUTPUT_ARMATURE, i], rows[ROTOR, i]
    if probed == BY_ROW_LIMIT:
        rows[ROW.limit, i] += PROBES[probed]
    elif probed == BY_ROW_COULOMB:
        rows[ROW.coulomb, i] += PROBES[probed]
    elif probed == BY_ROW_ARMATURE:
        apart = ROTOR_SHARE if rotor > 0.0 else 0.0
        rows[OUTPUT_ARMATURE, i] += (1.0 - apart) * PROBES[probed]
        rows[ROTOR, i] += apart * PROBES[probed]
    torque = output_torque(rows, memory, i, motion, wanted, seen[OUTPUT, i], supply, step)
    motion[0, i], motion[1, i] = q, v
    rows[ROW.limit, i], rows[ROW.coulomb, i], rows[OUTPUT_ARMATURE, i], rows[ROTOR, i] = limit, coulomb, carried, rotor
    return (
        torque, memory[BENT, i], memory[ROTOR_ANGLE, i], memory[ROTOR_SPEED, i], memory[SPEED, i],
        memory[THROUGH, i], memory[FRICTION, i],
    )  # fmt: skip


@compile_inner
def feedback_back(rows: np.ndarray, state: ServoState, now: Moment, adjoint: Adjoint, numbers: np.ndarray) -> None:
    """Pull the adjoints of wanted torques back to control errors, targets and encoders, the law apart.

    Args:
        rows: Of `ServoParameters`.
        state: Of this control period.
        now: Physics step.
        adjoint: Its `error` is filled in.
        numbers: Of `Gradient`, added to.
    """
    seen, held, sensed, length = now.seen, adjoint.held, adjoint.sensed, now.step / now.period
    for i in range(seen.shape[1]):
        error, by_u, motors = seen[ERROR, i], adjoint.wanted[i], seen.shape[1]
        of_kp, of_kd = gain_shares(rows, state.commands, i, motors, now.elapsed, now.step, now.period)
        gain, kd = of_kp * compute_gain(rows, state, i, now.elapsed), of_kd * rows[ROW.kd, i]
        by_error = where(abs(error) > rows[ROW.deadband, i], gain * by_u, 0.0)
        by_v = -kd * by_u
        kept = error - min(rows[ROW.deadband, i], max(-rows[ROW.deadband, i], error))
        numbers[BY_KP, i] += by_u * gain * kept
        numbers[BY_KD, i] += by_v * seen[RATE, i]
        if state.commands.shape[1] > motors:
            _beside_back(rows, state.commands, i, now, by_u, kd, numbers)
            if state.commands.shape[1] > BESIDE * motors:
                by_kp, by_kd = by_u * compute_gain(rows, state, i, now.elapsed) * kept, by_u * rows[ROW.kd, i]
                _shares_back(rows, state.commands, i, now, by_kp, by_kd, numbers)
        numbers[BY_DEADBAND, i] -= where(error > 0.0, by_error, -by_error)
        start = (now.elapsed - rows[ROW.delay, i]) / now.period
        by_target = _filter_back(rows, held, i, by_error, now.step)
        numbers[BY_DELAY, i] += by_target * slope_by_delay(state.commands, i, start, length) / now.period
        adjoint.error[i] = by_error
        encoder_back(rows, i, now.number, by_v, 1, now.step, sensed)


@compile_inner
def _beside_back(
    rows: np.ndarray, commands: np.ndarray, i: int, now: Moment, by_u: float, kd: float, numbers: np.ndarray
) -> None:
    """Add what motor i's desired speed and feed-forward torque make of kd, as it is sent, and of the delay."""
    start, length, motors = (now.elapsed - rows[ROW.delay, i]) / now.period, now.step / now.period, now.seen.shape[1]
    speed, _ = command_beside(rows, commands, i, motors, now.elapsed, now.step, now.period)
    later = kd * slope_by_delay(commands, motors + i, start, length)
    later += slope_by_delay(commands, 2 * motors + i, start, length)
    numbers[BY_KD, i] += by_u * kd * speed
    numbers[BY_DELAY, i] += by_u * later / now.period


@compile_inner
def _shares_back(
    rows: np.ndarray, commands: np.ndarray, i: int, now: Moment, by_kp: float, by_kd: float, numbers: np.ndarray
) -> None:
    """Add what the shares of motor i's gains make of the delay: `by_kp` a share of kp, `by_kd` one of kd and speed."""
    start, length, motors = (now.elapsed - rows[ROW.delay, i]) / now.period, now.step / now.period, now.seen.shape[1]
    speed, _ = command_beside(rows, commands, i, motors, now.elapsed, now.step, now.period)
    later = by_kp * slope_by_delay(commands, BESIDE * motors + i, start, length)
    later += by_kd * (speed - now.seen[RATE, i]) * slope_by_delay(commands, (BESIDE + 1) * motors + i, start, length)
    numbers[BY_DELAY, i] += later / now.period


@compile_inner
def _filter_back(rows: np.ndarray, held: np.ndarray, i: int, by_target: float, step: float) -> float:
    """Return the adjoint of motor i's target before its filter; rounding counts as what it is on average: nothing."""
    if rows[ROW.smoothing, i] > 0.0:
        new = 1.0 - np.exp(-step / rows[ROW.smoothing, i])
        by_target += held[SMOOTHED, i]
        held[SMOOTHED, i] = (1.0 - new) * by_target
        by_target *= new
    return by_target


@compile_inner
def slope_by_delay(commands: np.ndarray, i: int, start: float, length: float) -> float:
    """Return the derivative of a delayed target by its delay [rad per control period], see `servo.delayed`."""
    change = delay_command(commands, i, start - SHIFT * length, length) - delay_command(commands, i, start, length)
    return change / (SHIFT * length)


@compile_inner
def encoder_back(rows: np.ndarray, i: int, index: int, share: float, row: int, step: float, sensed: np.ndarray) -> None:
    """Give the adjoint of what an encoder tells at a physics step to the steps at which it was measured."""
    age = rows[ROW.sensor_delay, i] / step
    first = index - int(age)
    older = age - int(age)
    if first >= 0:
        sensed[first, row, i] += (1.0 - older) * share
    if first >= 1 and older > 0.0:
        sensed[first - 1, row, i] += older * share


@compile_inner
def take_sensed(rows: np.ndarray, number: int, adjoint: Adjoint) -> None:
    """Pass the adjoint of what was measured at a physics step to the outputs' motion, or to the rotors'."""
    moved, held, sensed = adjoint.moved, adjoint.held, adjoint.sensed[number]
    for i in range(moved.shape[1]):
        if rows[ROW.motor_encoder, i] * rows[ROTOR, i] > 0.0:
            held[ROTOR_ANGLE, i] += sensed[0, i]
            held[ROTOR_SPEED, i] += sensed[1, i]
        else:
            moved[0, i] += sensed[0, i]
            moved[1, i] += sensed[1, i]
