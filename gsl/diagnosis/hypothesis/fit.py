"""Fits of an effect's parameters together with the calibration: robust least squares with a ridge on its shifts.

A screening asks many values of one effect: there the shifts answer linearly, by sensitivities that were taken once.
A refinement takes all derivatives by finite differences where it stands (Levenberg-Marquardt).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from gsl.diagnosis.hypothesis.common_mode import Share, hand_over
from gsl.diagnosis.hypothesis.normal import Normal
from gsl.diagnosis.log.residual import loss, weight
from gsl.diagnosis.settings import FitSettings
from gsl.diagnosis.simulate.calibration import PROBES, SPREADS, ZERO, clip_shifts, no_shifts, prior_cost, prior_costs
from gsl.diagnosis.simulate.in_the_air import Effects
from gsl.diagnosis.simulate.simulator import Bench

FINE = 0.2  # of a probe where desired speeds leave little of an error: it would go past the valley that a fit follows
REWEIGHTINGS = 2  # of a linear fit whose residuals count less the larger they are

Build = Callable[[np.ndarray], Effects]


def sensitivities(bench: Bench, effects: Effects, at: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Return derivatives of the residuals to each joint's own shifts, shape (7, W, scored, n_joints).

    All joints are probed at once: a joint's answer to its neighbours' probes counts as its own.

    Args:
        bench: The log.
        effects: That are switched on.
        at: Shifts, shape (7, n_joints).
        base: Residuals there.
    """
    if not bench.simulator.calibrates:
        slopes, joints = np.zeros((len(PROBES), *base.shape)), len(bench.simulator.plant.robot.controlled)
        slopes[ZERO, ..., :joints] = 1.0 / bench.comparison.floor[:joints]
        return slopes
    columns = []
    for row, probe in enumerate(PROBES * (FINE if bench.pieces.wide else 1.0)):
        moved = at.copy()
        moved[row] += probe
        columns.append((bench.residual(effects, moved) - base) / probe)
    return np.array(columns)


def fit_shifts(z: np.ndarray, slopes: np.ndarray, at: np.ndarray, spread: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the best shifts, shape (7, n_joints), and each joint's cost with them, shape (n_joints,).

    Args:
        z: Residuals with shifts `at`, shape (W, scored, n_joints).
        slopes: From `sensitivities`.
        at: Shifts, shape (7, n_joints).
        spread: Of the shifts, as a share of the usual one.
    """
    flat = z.reshape(-1, z.shape[2])
    columns = slopes.reshape(len(slopes), -1, z.shape[2])
    sizes = spread * SPREADS
    precision, best, left = 1.0 / sizes**2, at, flat
    for _ in range(REWEIGHTINGS):
        w = weight(left)
        matrix = np.einsum("amj,mj,bmj->jab", columns, w, columns, optimize=True) + np.diag(precision)
        right = -np.einsum("amj,mj->ja", columns, w * flat) - precision * at.T
        best = clip_shifts(at + np.linalg.solve(matrix, right[..., None])[..., 0].T)
        left = flat + np.einsum("amj,aj->mj", columns, best - at)
    return best, loss(left).sum(axis=0) + prior_costs(best, spread)


def fit_proportional(
    z: np.ndarray, own: np.ndarray, slopes: np.ndarray, at: np.ndarray, spread: float = 1.0
) -> np.ndarray:
    """Return the best parameters of effects in proportion to them, shifts free, shape (p,).

    Args:
        z: Residuals without the effects, shifts `at`, shape (W, scored, n_joints).
        own: Derivatives to the parameters, shape (p, W, scored, n_joints).
        slopes: From `sensitivities`.
        at: Shifts, shape (7, n_joints).
        spread: Of the shifts, as a share of the usual one.
    """
    theta = np.zeros(len(own))
    for _ in range(REWEIGHTINGS):
        best, _ = fit_shifts(z + np.einsum("a,awsj->wsj", theta, own), slopes, at, spread)
        left = z + np.einsum("a,awsj->wsj", theta, own) + np.einsum("awsj,aj->wsj", slopes, best - at)
        theta = theta + Normal.of(left, own, slopes, best, spread).solve()[0]
    return theta


@dataclass(frozen=True)
class Fit:
    """Parameters and shifts at the lowest point of a descent.

    Attributes:
        parameters: Of the effects, shape (p,).
        shifts: Calibration, shape (7, n_joints).
        cost: Robust cost of the residuals and of the shifts.
        prior_cost: Of the shifts alone.
        covariance: Of the parameters, shifts free, shape (p, p).
    """

    parameters: np.ndarray
    shifts: np.ndarray
    cost: float
    prior_cost: float
    covariance: np.ndarray


class _Point(NamedTuple):
    """Where a descent is: parameters, shifts, residuals there and their cost."""

    theta: np.ndarray
    shifts: np.ndarray
    z: np.ndarray
    cost: float


@dataclass(frozen=True)
class Descent:
    """A descent on one part of a log.

    Attributes:
        bench: Training windows.
        build: From parameters to effects.
        bounds: Lower and upper ends of the parameters, shape (2, p).
        ratios: Which parameters multiply, and are stepped in their logarithms, shape (p,).
        common: What parameters share with the shifts.
        every: Steps for which sensitivities to the shifts are kept.
        rounds: Steps at most.
        settings: The rest.
    """

    bench: Bench
    build: Build
    bounds: np.ndarray
    ratios: np.ndarray
    common: Sequence[Share] = ()
    every: int = 1
    rounds: int = 4
    settings: FitSettings = field(default_factory=FitSettings)

    def fit(self, start: np.ndarray, at: np.ndarray) -> Fit:
        """Descend from parameters, shape (p,), and shifts, shape (7, n_joints)."""
        first = np.clip(start, *self.bounds)
        here, normal = self._descend(self._relieve(self._point(first, at)))
        poor = here.cost > self.settings.poor * here.z.size
        if len(first) and (poor or self.bench.comparison.shaking.any()):
            there, other = self._descend(self._search(here.theta))
            here, normal = (there, other) if there.cost < here.cost else (here, normal)
        scale = self._scale(here.theta)
        covariance = normal.covariance * np.outer(scale, scale)
        return Fit(here.theta, here.shifts, here.cost, prior_cost(here.shifts, self._spread), covariance)

    @property
    def _spread(self) -> float:
        return self.bench.simulator.spread

    def _point(self, theta: np.ndarray, shifts: np.ndarray) -> _Point:
        z = self.bench.residual(self.build(theta), shifts)
        return _Point(theta, shifts, z, float(loss(z).sum()) + prior_cost(shifts, self._spread))

    def _scale(self, theta: np.ndarray) -> np.ndarray:
        """Return how much a parameter moves by a unit of its step, shape (p,)."""
        return np.where(self.ratios, theta, 1.0)

    def _descend(self, here: _Point) -> tuple[_Point, Normal]:
        """Take Levenberg-Marquardt steps as long as they pay; return the last point and its normal equations."""
        age = self.every
        for _ in range(self.rounds):
            if age == self.every:
                slopes, age = sensitivities(self.bench, self.build(here.theta), here.shifts, here.z), 0
            own = self._own_slopes(here) * self._scale(here.theta)[:, None, None, None]
            normal = Normal.of(here.z, own, slopes, here.shifts, self._spread)
            before, here = here, self._relieve(self._step(here, normal))
            if before.cost - here.cost < self.settings.enough * before.cost:
                if age == 0:
                    break
                age = self.every - 1
            age += 1
        return here, normal

    def _step(self, here: _Point, normal: Normal) -> _Point:
        """Return the first of the damped steps that descends well, else the best, each joint damped as suits it."""
        points, most = [here], self.settings.parts
        for damping in self.settings.dampings:
            step, shift = normal.solve(damping)
            moved = np.where(self.ratios, here.theta * np.exp(np.clip(step, -most, most)), here.theta + step)
            shifts = clip_shifts(here.shifts + shift)
            points.append(self._point(np.clip(moved, *self.bounds), shifts))
            if points[-1].cost < (1.0 - self.settings.well) * here.cost:
                return min(points, key=_cost)
        best, each = min(points, key=_cost), np.argmin([self._by_joint(point) for point in points], axis=0)
        mixed = np.stack([points[k].shifts[:, joint] for joint, k in enumerate(each)], axis=1)
        return min(best, self._point(best.theta, mixed), key=_cost) if len({*each}) > 1 else best

    def _by_joint(self, here: _Point) -> np.ndarray:
        """Return what each joint's residuals and shifts cost, shape (n_joints,)."""
        return np.asarray(loss(here.z).sum(axis=(0, 1)) + prior_costs(here.shifts, self._spread))

    def _relieve(self, here: _Point) -> _Point:
        """Hand over to the parameters what shifts share, if that costs less."""
        if not self.common:
            return here
        return min(here, self._point(*hand_over(here.theta, here.shifts, self.bounds, self.common)), key=_cost)

    def _search(self, theta: np.ndarray) -> _Point:
        """Go on without derivatives, which mean little far off and where joints shake, factor by factor.

        The shifts are put back: where a fit is stuck they are what holds it.
        """
        none = no_shifts(self.bench.joints)
        best = self._point(theta, none)
        for k, factor in [(k, factor) for factor in self.settings.factors for k in range(len(theta))]:
            for direction in (factor, 1.0 / factor):
                while True:
                    moved = best.theta.copy()
                    moved[k] = np.clip(moved[k] * direction, *self.bounds[:, k])
                    new = self._point(moved, none)
                    if new.cost >= best.cost:
                        break
                    best = new
        return best

    def _own_slopes(self, here: _Point) -> np.ndarray:
        """Return derivatives to the parameters, shape (p, W, scored, n_joints), probed towards the inside of bounds."""
        columns = []
        for k, (low, high) in enumerate(self.bounds.T):
            probe = self.settings.probe * (high - low)
            probe = min(probe, self.settings.share * here.theta[k]) if low > 0.0 else probe
            probe = -probe if here.theta[k] + probe > high else probe
            moved = here.theta.copy()
            moved[k] += probe
            columns.append((self.bench.residual(self.build(moved), here.shifts) - here.z) / probe)
        return np.array(columns).reshape(len(here.theta), *here.z.shape)


def _cost(here: _Point) -> float:
    return here.cost
