"""The second step of learning a servo: numbers joint by joint, lags and network, by L-BFGS with adjoint gradients."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from gsl.core.lanes import LANES
from gsl.core.plant import Plant
from gsl.core.servo_law import LAGS
from gsl.core.step_metrics import note_step
from gsl.models.servo import NETWORK, NUMBERS, ServoModel, shapes, units
from gsl.training.adjoint import cost_and_gradient
from gsl.training.frozen import Frozen, heavier
from gsl.training.gradient import NUMBERS as SLOPES
from gsl.training.gradient import Gradient
from gsl.worlds.servo_state import OUTPUT_ARMATURE, pack

ROBUST = 3.0  # residual beyond which one counts less and less [floors]
RIDGE_LAG, RIDGE_WEIGHT = 1e-2, 1e-4  # of squares, in mean squares of a residual
RIDGE_NUMBER, RIDGE_APART = 1e-5, 1e-3  # of a number's squares, and of its distance from its group's mean


class Progress(NamedTuple):
    """Where an optimisation stood: cost on its own windows, and what the judge says."""

    cost: float
    level: float


class Alike(NamedTuple):
    """Windows whose records share what is known of them, and the plant under it."""

    plant: Plant
    data: Frozen


class _Free:
    """What is free, as one vector: numbers of joints in units, a group's lags, the networks."""

    def __init__(self, plant: Plant, model: ServoModel, longest: float) -> None:
        self.plant, self.model, self.longest = plant, model, longest
        self.joints, self.groups = len(plant.robot.controlled), len(model.groups)
        self.sizes = (SLOPES * self.joints, self.groups * LAGS)
        self.unit = np.array([units(plant)[name] for name in NUMBERS[:SLOPES]])
        group = model.group[: self.joints]
        same = (group[:, None] == group[None, :]).astype(float)
        self.apart = np.eye(self.joints) - same / same.sum(axis=1, keepdims=True)
        numbers = np.array([model.numbers[name] for name in NUMBERS[:SLOPES]])
        self.begun = numbers[:, : self.joints] / self.unit[:, : self.joints]
        lag = np.array([model.lag[model.group == g].mean(axis=0) for g in range(self.groups)])
        weights = [model.network[name].ravel() for name in NETWORK]
        self.start = np.concatenate([np.zeros(self.sizes[0]), lag.ravel(), *weights])

    def parts(self, theta: np.ndarray) -> list[np.ndarray]:
        return np.split(theta, np.cumsum(self.sizes))

    def model_at(self, theta: np.ndarray) -> ServoModel:
        numbers, lag, weights = self.parts(theta)
        change = np.zeros((len(NUMBERS), self.joints))
        change[:SLOPES] = numbers.reshape(SLOPES, -1)
        moved, network, k = self.model.shift(self.plant, change).within(self.plant, self.longest), {}, 0
        for name, shape in shapes(self.groups).items():
            size = int(np.prod(shape))
            network[name], k = weights[k : k + size].reshape(shape).copy(), k + size
        return replace(moved, lag=lag.reshape(self.groups, LAGS)[self.model.group], network=network)

    def gradient(self, to: Gradient) -> np.ndarray:
        numbers = np.zeros((SLOPES, self.joints))
        for motor, joint in enumerate(self.plant.robot.drive):
            numbers[:, joint] += to.numbers[:, motor] * self.unit[:, motor]
        lag = np.array([to.lag[self.model.group == g].sum(axis=0) for g in range(self.groups)])
        return np.concatenate([numbers.ravel(), lag.ravel(), *(getattr(to, name).ravel() for name in NETWORK)])

    def ridge(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        numbers, lag, weights = self.parts(theta)
        own = self.begun + numbers.reshape(self.begun.shape)
        off = own @ self.apart
        drift = weights - self.parts(self.start)[2]
        cost = RIDGE_NUMBER * (own**2).sum() + RIDGE_APART * (off**2).sum()
        cost += RIDGE_LAG * lag @ lag + RIDGE_WEIGHT * drift @ drift
        slopes = RIDGE_NUMBER * own + RIDGE_APART * off, RIDGE_LAG * lag, RIDGE_WEIGHT * drift
        return float(cost), 2.0 * np.concatenate([slope.ravel() for slope in slopes])


def fit_network(
    plant: Plant, model: ServoModel, windows: Sequence[Alike], step: float, period: float, pool: Executor, *,
    judge: Callable[[ServoModel], float], longest: float = np.inf, iterations: int = 300, every: int = 10,
    patience: int = 6,
) -> tuple[ServoModel, list[Progress]]:  # fmt: skip
    """Return the model fitted to some windows, as the judge likes it best on the way, and the way.

    What lies side by side is always the same, and so is the order of sums: the number of threads changes no bit.

    Args:
        plant: The servo that the model stands on.
        model: Where to begin.
        windows: That are fitted, each kind frozen for its plant.
        step: Physics period [s].
        period: Control period [s].
        pool: Threads that replay side by side.
        judge: Returns the level of a model on windows that are not fitted.
        longest: Delay of the target that a simulator can remember [s].
        iterations: Of L-BFGS, at most.
        every: Iterations from one judgement to the next.
        patience: Judgements without a better one after which it ends.
    """
    free, scored = _Free(plant, model, longest), sum(alike.data.real[:, alike.data.warm_up :].size for alike in windows)
    best, way, costs = [(judge(model), model)], list[Progress](), [0.0]
    lanes = [(k, np.arange(len(alike.data.clock))) for k, alike in enumerate(windows)]
    blocks = [(k, index[at : at + LANES]) for k, index in lanes for at in range(0, len(index), LANES)]

    carried = [pack(alike.plant.servo, alike.plant.robot.supply_voltage).rows[OUTPUT_ARMATURE] for alike in windows]

    def value(theta: np.ndarray) -> tuple[float, np.ndarray]:
        now = free.model_at(theta)
        changed = [now.on(alike.plant) for alike in windows]
        servos = [pack(plant.servo, plant.robot.supply_voltage, plant.law) for plant in changed]
        more = [own.rows[OUTPUT_ARMATURE] - before for own, before in zip(servos, carried, strict=True)]
        here = [heavier(alike.data, inertia) for alike, inertia in zip(windows, more, strict=True)]

        def of(block: tuple[int, np.ndarray]) -> tuple[float, np.ndarray]:
            kind, index = block
            arrays = map(np.zeros, shapes(free.groups).values())
            to = Gradient(np.zeros_like(free.unit), np.zeros_like(now.lag), *arrays)
            cost = cost_and_gradient(servos[kind], here[kind], index, step, round(period / step), ROBUST, to)
            return cost, free.gradient(to)

        done = list(pool.map(of, blocks))
        cost, slope = free.ridge(theta)
        costs[0] = sum(part for part, _ in done) / scored
        return costs[0] + cost, np.sum([gradient for _, gradient in done], axis=0) / scored + slope

    def watch(theta: np.ndarray) -> None:
        way.append(Progress(costs[0], np.nan))
        note_step("servo", len(way), cost=costs[0])
        if len(way) % every:
            return
        now = free.model_at(theta)
        level = judge(now)
        way[-1] = Progress(costs[0], level)
        if level < best[0][0]:
            best[0] = level, now
        elif (
            np.argmin([np.inf if np.isnan(progress.level) else progress.level for progress in way])
            < len(way) - every * patience
        ):
            raise StopIteration

    options = {"maxiter": iterations, "maxcor": 30, "maxfun": 2 * iterations}
    minimize(value, free.start, jac=True, method="L-BFGS-B", callback=watch, options=options)
    return best[0][1], way
