"""The second step of learning a servo: numbers of joints, lags and network, by L-BFGS with the adjoint's gradient."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from gsl.core.lanes import LANES
from gsl.core.plant import Plant
from gsl.core.servo_law import LAGS
from gsl.models.servo import NETWORK, NUMBERS, ServoModel, shapes, units
from gsl.training.adjoint import cost_and_gradient
from gsl.training.frozen import Frozen, heavier
from gsl.training.gradient import Gradient
from gsl.worlds.servo_state import OUTPUT_ARMATURE, packed

ROBUST = 3.0  # residual beyond which one counts less and less [floors]
RIDGE_LAG, RIDGE_WEIGHT = 1e-2, 1e-4  # of squares, in mean squares of a residual
RIDGE_NUMBER, RIDGE_APART = 1e-5, 1e-3  # of a number's squares, and of its distance from its group's mean


class Progress(NamedTuple):
    """Where an optimisation stood: cost on its own windows, and what the judge says."""

    cost: float
    level: float


class _Free:
    """What is free, as one vector: numbers of joints in units, a group's lags, the networks."""

    def __init__(self, plant: Plant, model: ServoModel) -> None:
        self.plant, self.model = plant, model
        self.joints, self.groups = len(plant.robot.controlled), len(model.groups)
        self.sizes = (len(NUMBERS) * self.joints, self.groups * LAGS)
        self.unit = np.array([units(plant)[name] for name in NUMBERS])
        group = model.group[: self.joints]
        same = (group[:, None] == group[None, :]).astype(float)
        self.apart = np.eye(self.joints) - same / same.sum(axis=1, keepdims=True)
        self.begun = np.array([model.numbers[name] for name in NUMBERS])[:, : self.joints] / self.unit[:, : self.joints]
        lag = np.array([model.lag[model.group == g].mean(axis=0) for g in range(self.groups)])
        weights = [model.network[name].ravel() for name in NETWORK]
        self.start = np.concatenate([np.zeros(self.sizes[0]), lag.ravel(), *weights])

    def parts(self, theta: np.ndarray) -> list[np.ndarray]:
        return np.split(theta, np.cumsum(self.sizes))

    def model_at(self, theta: np.ndarray) -> ServoModel:
        numbers, lag, weights = self.parts(theta)
        moved, network, k = self.model.moved(self.plant, numbers.reshape(len(NUMBERS), -1)), {}, 0
        for name, shape in shapes(self.groups).items():
            size = int(np.prod(shape))
            network[name], k = weights[k : k + size].reshape(shape).copy(), k + size
        return replace(moved, lag=lag.reshape(self.groups, LAGS)[self.model.group], network=network)

    def gradient(self, to: Gradient) -> np.ndarray:
        numbers = np.zeros((len(NUMBERS), self.joints))
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
    plant: Plant, model: ServoModel, data: Frozen, some: np.ndarray, step: float, period: float, *,
    judge: Callable[[ServoModel], float], iterations: int = 300, every: int = 10, patience: int = 6, threads: int = 1,
) -> tuple[ServoModel, list[Progress]]:  # fmt: skip
    """Return the model fitted to some windows, as the judge likes it best on the way, and the way.

    Args:
        plant: The servo that the model stands on.
        model: Where to begin.
        data: Windows, frozen for `plant`.
        some: Those that are fitted, shape (k,).
        step: Physics period [s].
        period: Control period [s].
        judge: Returns the level of a model on windows that are not fitted.
        iterations: Of L-BFGS, at most.
        every: Iterations from one judgement to the next.
        patience: Judgements without a better one after which it ends.
        threads: That replay side by side.
    """
    free, scored = _Free(plant, model), data.real[0, data.warm_up :].size * len(some)
    best, way, costs = [(judge(model), model)], list[Progress](), [0.0]
    size = -(-len(some) // (LANES * threads)) * LANES
    blocks = [some[k : k + size] for k in range(0, len(some), size)]
    carried = packed(plant.servo, plant.robot.supply_voltage).rows[OUTPUT_ARMATURE]

    with ThreadPoolExecutor(threads) as pool:

        def value(theta: np.ndarray) -> tuple[float, np.ndarray]:
            now = free.model_at(theta)
            changed = now.on(plant)
            servos = packed(changed.servo, changed.robot.supply_voltage, changed.law)
            here = heavier(data, servos.rows[OUTPUT_ARMATURE] - carried)

            def of(block: np.ndarray) -> tuple[float, np.ndarray]:
                to = Gradient(
                    np.zeros_like(free.unit), np.zeros_like(now.lag), *map(np.zeros, shapes(free.groups).values())
                )
                return cost_and_gradient(servos, here, block, step, round(period / step), ROBUST, to), free.gradient(to)

            done = list(pool.map(of, blocks))
            cost, slope = free.ridge(theta)
            costs[0] = sum(one for one, _ in done) / scored
            return costs[0] + cost, np.sum([one for _, one in done], axis=0) / scored + slope

        def watch(theta: np.ndarray) -> None:
            way.append(Progress(costs[0], np.nan))
            if len(way) % every:
                return
            now = free.model_at(theta)
            level = judge(now)
            way[-1] = Progress(costs[0], level)
            if level < best[0][0]:
                best[0] = level, now
            elif np.argmin([np.inf if np.isnan(one.level) else one.level for one in way]) < len(way) - every * patience:
                raise StopIteration

        options = {"maxiter": iterations, "maxcor": 30, "maxfun": 2 * iterations}
        minimize(value, free.start, jac=True, method="L-BFGS-B", callback=watch, options=options)
    return best[0][1], way
