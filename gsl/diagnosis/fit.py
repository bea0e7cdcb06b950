"""Fits of an effect's parameters together with the nuisances: robust least squares with a ridge on the nuisances.

A screening asks many values of one effect: there the nuisances answer linearly, by sensitivities that were taken once.
A refinement takes all derivatives by finite differences where it stands (Levenberg-Marquardt).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gsl.diagnosis import nuisance
from gsl.diagnosis.replay import Bench, Effects
from gsl.diagnosis.residual import loss, weight
from gsl.diagnosis.shared import Share, handed_over

REWEIGHTINGS = 2
DAMPINGS = (0.0, 1.0, 30.0)  # of a step, as shares of the diagonal: friction's derivatives hold nearby only
WELL = 0.05  # relative descent of a step that others are not tried beside
FACTORS = (1.2, 1.08)  # of a parameter, in a search where joints shake or the fit is poor
POOR = 1.5  # cost of a residual that makes a search worth its time
ENOUGH = 1e-3  # relative descent at which a fit ends

Build = Callable[[np.ndarray], Effects]


def sensitivities(bench: Bench, effects: Effects, at: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Return derivatives of the residuals to each joint's own nuisances, shape (7, W, scored, n_joints).

    All joints are probed at once: a joint's answer to its neighbours' probes counts as its own.

    Args:
        bench: The log.
        effects: That are switched on.
        at: Nuisances, shape (7, n_joints).
        base: Residuals there.
    """
    if not bench.simulator.calibrates:
        slopes, joints = np.zeros((len(nuisance.PROBES), *base.shape)), len(bench.simulator.plant.robot.controlled)
        slopes[nuisance.ZERO, ..., :joints] = 1.0 / bench.comparison.floor[:joints]
        return slopes
    columns = []
    for row, probe in enumerate(nuisance.PROBES):
        moved = at.copy()
        moved[row] += probe
        columns.append((bench.residual(effects, moved) - base) / probe)
    return np.array(columns)


def projected(z: np.ndarray, slopes: np.ndarray, at: np.ndarray, spread: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the best nuisances, shape (7, n_joints), and each joint's cost with them, shape (n_joints,).

    Args:
        z: Residuals with nuisances `at`, shape (W, scored, n_joints).
        slopes: From `sensitivities`.
        at: Nuisances, shape (7, n_joints).
        spread: Of the nuisances, as a share of the usual one.
    """
    flat = z.reshape(-1, z.shape[2])
    columns = slopes.reshape(len(slopes), -1, z.shape[2])
    sizes = spread * nuisance.SIZES
    precision, best, left = 1.0 / sizes**2, at, flat
    for _ in range(REWEIGHTINGS):
        w = weight(left)
        matrix = np.einsum("amj,mj,bmj->jab", columns, w, columns, optimize=True) + np.diag(precision)
        right = -np.einsum("amj,mj->ja", columns, w * flat) - precision * at.T
        best = nuisance.bounded(at + np.linalg.solve(matrix, right[..., None])[..., 0].T)
        left = flat + np.einsum("amj,aj->mj", columns, best - at)
    return best, loss(left).sum(axis=0) + ((best / sizes[:, None]) ** 2).sum(axis=0)


def proportional(z: np.ndarray, own: np.ndarray, slopes: np.ndarray, at: np.ndarray, spread: float = 1.0) -> np.ndarray:
    """Return the best parameters of effects in proportion to them, nuisances free, shape (p,).

    Args:
        z: Residuals without the effects, nuisances `at`, shape (W, scored, n_joints).
        own: Derivatives to the parameters, shape (p, W, scored, n_joints).
        slopes: From `sensitivities`.
        at: Nuisances, shape (7, n_joints).
        spread: Of the nuisances, as a share of the usual one.
    """
    theta = np.zeros(len(own))
    for _ in range(REWEIGHTINGS):
        best, _ = projected(z + np.einsum("a,awsj->wsj", theta, own), slopes, at, spread)
        left = z + np.einsum("a,awsj->wsj", theta, own) + np.einsum("awsj,aj->wsj", slopes, best - at)
        matrix, right = _normal(left, own, slopes, best, spread)
        theta = theta + np.linalg.solve(matrix, right)[: len(own)]
    return theta


@dataclass(frozen=True)
class Fit:
    """Parameters and nuisances at the best point found.

    Attributes:
        parameters: Of the effects, shape (p,).
        nuisances: Shape (7, n_joints).
        cost: Robust cost of the residuals and of the nuisances.
        toll: Of the nuisances alone.
        covariance: Of the parameters, nuisances free, shape (p, p).
    """

    parameters: np.ndarray
    nuisances: np.ndarray
    cost: float
    toll: float
    covariance: np.ndarray


def refined(
    bench: Bench,
    build: Build,
    start: np.ndarray,
    bounds: np.ndarray,
    at: np.ndarray,
    *,
    ratios: np.ndarray | None = None,
    common: Sequence[Share] = (),
    every: int = 1,
    rounds: int = 4,
) -> Fit:
    """Descend from a start.

    Args:
        bench: Training windows.
        build: From parameters to effects.
        start: Parameters, shape (p,).
        bounds: Lower and upper, shape (2, p).
        at: Nuisances to begin with, shape (7, n_joints).
        ratios: Which parameters multiply, and are stepped in their logarithms as such nuisances are, shape (p,).
        common: What parameters share with the nuisances.
        every: Steps for which sensitivities to the nuisances, which change little, are kept.
        rounds: Steps at most.
    """
    multiplies = np.zeros(len(start), dtype=bool) if ratios is None else ratios
    problem = _Problem(bench, build, bounds, multiplies, common)
    first = np.clip(start, *bounds)
    here = _relieved(problem, problem.at(first, at))
    here, matrix = _descended(problem, here, every, rounds)
    if len(first) and (here.cost > POOR * here.z.size or bench.comparison.shaking.any()):
        there, other = _descended(problem, _searched(bench, build, here, bounds), every, rounds)
        here, matrix = (there, other) if there.cost < here.cost else (here, matrix)
    scale = problem.scale(here.theta)
    covariance = np.linalg.inv(matrix)[: len(first), : len(first)] * np.outer(scale, scale)
    return Fit(here.theta, here.nuisances, here.cost, nuisance.cost(here.nuisances, bench.simulator.spread), covariance)


class _Problem(NamedTuple):
    """What a descent works on: windows, effects, their parameters' bounds, which multiply, which nuisances know too."""

    bench: Bench
    build: Build
    bounds: np.ndarray
    ratios: np.ndarray
    common: Sequence[Share]

    def at(self, theta: np.ndarray, nuisances: np.ndarray) -> _Point:
        """Return the point with its residuals and their cost."""
        z = self.bench.residual(self.build(theta), nuisances)
        return _Point(theta, nuisances, z, float(loss(z).sum()) + nuisance.cost(nuisances, self.bench.simulator.spread))

    def scale(self, theta: np.ndarray) -> np.ndarray:
        """Return how much a parameter moves by a unit of its step, shape (p,)."""
        return np.where(self.ratios, theta, 1.0)

    def moved(self, theta: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return parameters after a step, shape (p,)."""
        return np.clip(np.where(self.ratios, theta * np.exp(np.clip(step, -2.0, 2.0)), theta + step), *self.bounds)


class _Point(NamedTuple):
    """Where a descent is: parameters, nuisances, residuals there and their cost."""

    theta: np.ndarray
    nuisances: np.ndarray
    z: np.ndarray
    cost: float


def _descended(problem: _Problem, here: _Point, every: int, rounds: int) -> tuple[_Point, np.ndarray]:
    """Take Levenberg-Marquardt steps as long as they pay; return the last point and normal matrix."""
    bench, build = problem.bench, problem.build
    matrix, age = np.eye(len(here.theta) + here.nuisances.size), every
    for _ in range(rounds):
        if age == every:
            slopes, age = sensitivities(bench, build(here.theta), here.nuisances, here.z), 0
        own = _own_slopes(bench, build, here.theta, problem.bounds, here.nuisances, here.z)
        own = own * problem.scale(here.theta)[:, None, None, None]
        matrix, right = _normal(here.z, own, slopes, here.nuisances, bench.simulator.spread)
        before, here = here, _relieved(problem, _stepped(problem, here, matrix, right))
        if before.cost - here.cost < ENOUGH * before.cost:
            if age == 0:
                break
            age = every - 1
        age += 1
    return here, matrix


def _stepped(problem: _Problem, here: _Point, matrix: np.ndarray, right: np.ndarray) -> _Point:
    """Return the first of the damped steps that descends well, else the best, else the point itself."""
    p, best = len(here.theta), here
    for damping in DAMPINGS:
        step = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), right)
        theta = problem.moved(here.theta, step[:p])
        nuisances = nuisance.bounded(here.nuisances + step[p:].reshape(here.nuisances.shape))
        best = min(best, problem.at(theta, nuisances), key=_cost)
        if best.cost < (1.0 - WELL) * here.cost:
            break
    return best


def _relieved(problem: _Problem, here: _Point) -> _Point:
    """Hand over to the parameters what nuisances share, if that costs less."""
    if not problem.common:
        return here
    return min(here, problem.at(*handed_over(here.theta, here.nuisances, problem.bounds, problem.common)), key=_cost)


def _cost(here: _Point) -> float:
    return here.cost


def _searched(bench: Bench, build: Build, here: _Point, bounds: np.ndarray) -> _Point:
    """Go on without derivatives, which mean little far off and where joints shake, factor by factor.

    The nuisances are put back: where a fit is stuck they are what holds it.
    """
    none = nuisance.none(here.nuisances.shape[1])

    def at(theta: np.ndarray) -> _Point:
        z = bench.residual(build(theta), none)
        return _Point(theta, none, z, float(loss(z).sum()))

    best = at(here.theta)
    for k, factor in [(k, factor) for factor in FACTORS for k in range(len(here.theta))]:
        for direction in (factor, 1.0 / factor):
            while True:
                moved = best.theta.copy()
                moved[k] = np.clip(moved[k] * direction, *bounds[:, k])
                new = at(moved)
                if new.cost >= best.cost:
                    break
                best = new
    return best


def _own_slopes(
    bench: Bench, build: Build, theta: np.ndarray, bounds: np.ndarray, n: np.ndarray, z: np.ndarray
) -> np.ndarray:
    """Return derivatives to the parameters, shape (p, W, scored, n_joints), probed towards the inside of the bounds."""
    columns = []
    for k in range(len(theta)):
        probe = 0.02 * (bounds[1, k] - bounds[0, k])
        probe = min(probe, 0.2 * theta[k]) if bounds[0, k] > 0.0 else probe
        probe = -probe if theta[k] + probe > bounds[1, k] else probe
        moved = theta.copy()
        moved[k] += probe
        columns.append((bench.residual(build(moved), n) - z) / probe)
    return np.array(columns).reshape(len(theta), *z.shape)


def _normal(
    z: np.ndarray, own: np.ndarray, slopes: np.ndarray, n: np.ndarray, spread: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal equations of (parameters, nuisances), of shapes (p + 7 n, p + 7 n) and (p + 7 n,)."""
    p, joints = len(own), z.shape[2]
    w, size = weight(z), p + n.size
    matrix, right = np.zeros((size, size)), np.zeros(size)
    weighted = own * w
    matrix[:p, :p] = np.einsum("awsj,bwsj->ab", weighted, own)
    right[:p] = -np.einsum("awsj,wsj->a", weighted, z)
    cross = np.einsum("awsj,bwsj->abj", weighted, slopes).reshape(p, n.size)
    matrix[:p, p:], matrix[p:, :p] = cross, cross.T
    blocks = np.einsum("awsj,wsj,bwsj->abj", slopes, w, slopes, optimize=True)
    for a in range(len(slopes)):
        for b in range(len(slopes)):
            at_a, at_b = p + a * joints + np.arange(joints), p + b * joints + np.arange(joints)
            matrix[at_a, at_b] = blocks[a, b]
    precision = np.repeat(1.0 / (spread * nuisance.SIZES) ** 2, joints)
    matrix[range(p, size), range(p, size)] += precision
    matrix[range(p), range(p)] += 1e-9 * np.abs(np.diag(matrix)[:p]) + 1e-12
    right[p:] = -np.einsum("awsj,wsj->aj", slopes, w * z).ravel() - precision * n.ravel()
    return matrix, right
