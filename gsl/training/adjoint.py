"""The gradient of a replay's cost in the numbers and weights of a learned servo, by a hand-written adjoint.

Windows of a log are replayed as the chain model does, with its rigid-body terms frozen at the measured motion:

    dv/dt = M⁻¹(q measured) tau + free(q, v measured)      tau = servo(q, v, memory; law)

That is exact where the replay is right and keeps the adjoint short: back through one physics step it needs M⁻¹, the
network's own chain rule (law_back.py), and the derivatives of the servo below the law (servo_back.py).
"""

from __future__ import annotations

import numpy as np

from gsl.core.compiled import compile_inner, compile_kernel
from gsl.core.lanes import LANES, side_by_side, zeros_in_lanes
from gsl.core.servo_law import HIDDEN, LAYERS
from gsl.training.frozen import Frozen
from gsl.training.gradient import BY_OFFSET, Gradient, add_lanes, sums_in_lanes
from gsl.training.law_back import law_back
from gsl.training.replay_path import ROWS, Moment, Path, cube, load, replay, score
from gsl.training.servo_back import (
    OUTCOMES,
    PROBED,
    Adjoint,
    Work,
    encoder_back,
    feedback_back,
    output_back,
    take_sensed,
)
from gsl.worlds.encoder import REMEMBERED
from gsl.worlds.servo_state import COMMANDS, MEMORY, ServoParameters, ServoState


@compile_kernel
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
        to: Derivatives, added to; what runs away has a cost and no derivatives.
    """
    total = 0.0
    for first in range(0, len(some), LANES):
        total += _side_by_side(servos, data, some[first : first + LANES], step, substeps, robust, to)
    return total


@compile_kernel
def _side_by_side(
    servos: ServoParameters, data: Frozen, some: np.ndarray, step: float, substeps: int, robust: float, to: Gradient
) -> float:
    (periods, n), m = data.free.shape[1:], data.real.shape[2]
    steps, loaded = periods * substeps, load(data, some)
    state = ServoState(
        side_by_side(loaded.commands), side_by_side(zeros_in_lanes(MEMORY, n)), side_by_side(cube(REMEMBERED, 2, n)),
        side_by_side(zeros_in_lanes(1, 1))[0], np.array([0, 1]),
        side_by_side(zeros_in_lanes(LAYERS, HIDDEN)),
    )  # fmt: skip
    measured, slopes, sums = cube(periods, 2, n), zeros_in_lanes(periods, m), sums_in_lanes(n, len(to.last_bias))
    path = Path(
        state, side_by_side(loaded.clock)[0], side_by_side(loaded.mobility), side_by_side(loaded.free),
        side_by_side(cube(steps + 1, 2, n)), side_by_side(cube(steps, MEMORY, n)), side_by_side(cube(steps, ROWS, n)),
        side_by_side(measured),
    )  # fmt: skip
    replay(servos, path, side_by_side(loaded.motion), step, substeps)
    cost = score(data, some, robust, measured, slopes)
    by = Gradient(
        side_by_side(sums.numbers), side_by_side(sums.lag), side_by_side(sums.first), side_by_side(sums.first_bias),
        side_by_side(sums.second), side_by_side(sums.second_bias), side_by_side(sums.last),
        side_by_side(sums.last_bias),
    )  # fmt: skip
    _back(ServoParameters(servos.rows.copy(), servos.weights), path, side_by_side(slopes), step, substeps, by)
    add_lanes(to, sums, len(some))
    return cost


@compile_kernel
def _back(servos: ServoParameters, path: Path, slopes: np.ndarray, step: float, substeps: int, to: Gradient) -> None:
    """Add the derivatives of replayed windows.

    Args:
        servos: With the law; numbers are changed in between.
        path: Of the replay.
        slopes: Derivatives of the cost by the measured positions [1/rad], shape (T, m).
        step: Physics period [s].
        substeps: Physics steps in a control period.
        to: Derivatives, in lanes.
    """
    (periods, n), rows, whole, period = path.free.shape, servos.rows, path.state, substeps * step
    torques = side_by_side(zeros_in_lanes(4, n))
    adjoint = Adjoint(
        side_by_side(zeros_in_lanes(2, n)), side_by_side(zeros_in_lanes(MEMORY, n)),
        side_by_side(cube(periods * substeps + 1, 2, n)), torques[0], torques[1], torques[2], torques[3],
    )  # fmt: skip
    work = Work(
        side_by_side(zeros_in_lanes(PROBED, OUTCOMES)), side_by_side(zeros_in_lanes(MEMORY, n)),
        side_by_side(zeros_in_lanes(1, HIDDEN))[0], side_by_side(zeros_in_lanes(2, HIDDEN)),
    )  # fmt: skip
    for t in range(periods - 1, -1, -1):
        commands = whole.commands[periods - 1 - t : periods - 1 - t + COMMANDS]
        state = ServoState(commands, whole.memory, whole.history, whole.clock, whole.steps, whole.layers)
        state.clock[0] = path.begin[0] + t * period
        for i in range(slopes.shape[1]):
            encoder_back(rows, i, (t + 1) * substeps, slopes[t, i], 0, step, adjoint.sensed)
        for k in range(substeps - 1, -1, -1):
            s = t * substeps + k
            motion, after, memory, seen = path.motion[s], path.motion[s + 1], path.memory[s], path.seen[s]
            now = Moment(s, k * step, step, period, motion, after, memory, seen)
            _links_back(rows, path.mobility[t], now, adjoint)
            output_back(rows, now, adjoint, work, to.numbers)
            feedback_back(rows, state, now, adjoint, to.numbers)
            law_back(servos, state, now, adjoint, work, to)
            for i in range(n):
                to.numbers[BY_OFFSET, i] += adjoint.error[i]
                encoder_back(rows, i, s, -adjoint.error[i], 0, step, adjoint.sensed)


@compile_inner
def _links_back(rows: np.ndarray, mobility: np.ndarray, now: Moment, adjoint: Adjoint) -> None:
    """Fill in the adjoint of the torques, and move that of the motion to the beginning of the step, torques given."""
    moved, push, step = adjoint.moved, adjoint.push, now.step
    take_sensed(rows, now.number + 1, adjoint)
    for i in range(len(push)):
        moved[1, i] += step * moved[0, i]
    for j in range(len(push)):
        push[j] = 0.0
    for i in range(len(push)):
        for j in range(len(push)):
            push[j] += step * mobility[i, j] * moved[1, i]
