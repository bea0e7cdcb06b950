"""A rehearsal: experiments that nobody has done yet, simulated with one explanation and judged by another.

T-optimal discrimination (Atkinson and Fedorov 1975): the best experiment is the one in which the truth stays farthest
from its rival, after the rival has been refitted to it. Here the calibration of every joint is refitted, linearly.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from gsl.core.body import Robot
from gsl.diagnosis import nuisance
from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.experiment import SCORED, WARM_UP, Experiment
from gsl.diagnosis.fit import projected
from gsl.diagnosis.menu import Dish
from gsl.diagnosis.records import Pieces, Record, pieces
from gsl.diagnosis.replay import Effects, Simulator
from gsl.diagnosis.residual import Comparison
from gsl.diagnosis.self_test import simulated
from gsl.effects.effect import applied, built
from gsl.worlds.fits import fitting_step

THREADS = 2  # more would hold more logs at once for little


class Explanation(NamedTuple):
    """Effects and the calibration, shape (7, n_joints), that go with them."""

    effects: Effects
    nuisances: np.ndarray


class Rival(NamedTuple):
    """What an explanation would log from several starts, and how that changes with its calibration.

    `slopes` are each of shape (n_nuisances, W, scored, n_joints).
    """

    starts: tuple[Explanation, ...]
    bases: tuple[Pieces, ...]
    slopes: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class Rehearsal:
    """Where motions in the air are tried out; a motion is one record or several.

    Attributes:
        experiment: With the records, of which only the commands count.
        simulator: The user's.
        comparison: How joints are compared.
        owner: Number of each record's motion, shape (n_records,).
    """

    experiment: Experiment
    simulator: Simulator
    comparison: Comparison
    owner: np.ndarray
    _ready: dict[int, Rival] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def of(cls, found: Findings, dishes: Sequence[Dish]) -> Rehearsal:
        """Prepare the rehearsal of a menu, of each dish the first variant, for what a diagnosis left open."""
        robot = found.experiment.robot
        records = [_commanded(*one.variants[0], robot) for one in dishes]
        return _rehearsal(found, records, np.arange(len(dishes)))

    @classmethod
    def again(cls, found: Findings) -> Rehearsal:
        """Prepare to go through the diagnosed log in the air once more, all of it as one motion."""
        records = found.experiment.records
        return _rehearsal(found, [replace(one, base=None) for one in records], np.zeros(len(records), dtype=int))

    def log_odds(self, truth: Explanation, rivals: tuple[Explanation, ...], *, loose: float = 1.0) -> np.ndarray:
        """Return how far each motion is expected to speak for the truth, natural logarithm, shape (n_motions,).

        Args:
            truth: What makes the log.
            rivals: What has to explain it, refitted to it from whichever of these starts suits a joint best.
            loose: How far the rivals' calibration may go, in its usual spread.
        """
        if id(rivals) not in self._ready:
            self._ready[id(rivals)] = self._against(rivals)
        rival, told = self._ready[id(rivals)], self.logged(truth)
        owner, motions = self.owner[told.record], range(self.owner.max() + 1)
        costs = []
        for base, slopes in zip(rival.bases, rival.slopes, strict=True):
            z = self._residual(told, base)
            costs.append([_costs(z[owner == k], loose * slopes[:, owner == k]) for k in motions])
        odds: np.ndarray = 0.5 * np.min(costs, axis=0).sum(axis=1)
        return odds

    def _against(self, rivals: tuple[Explanation, ...]) -> Rival:
        probes = ((-1, 1.0), *enumerate(nuisance.PROBES))
        with ThreadPoolExecutor(THREADS) as pool:
            logs = list(pool.map(self.logged, [_moved(one, *probe) for one in rivals for probe in probes]))
        bases, slopes = logs[:: len(probes)], []
        for k, base in enumerate(bases):
            moved = logs[k * len(probes) + 1 : (k + 1) * len(probes)]
            pairs = zip(moved, nuisance.PROBES, strict=True)
            slopes.append(np.array([self._residual(one, base) / probe for one, probe in pairs]))
        return Rival(rivals, tuple(bases), tuple(slopes))

    def logged(self, truth: Explanation) -> Pieces:
        """Return what would be logged, without noise."""
        sim, exp = self.simulator, self.experiment
        plant = nuisance.calibrated(applied(sim.plant, built(truth.effects)), truth.nuisances)
        made = simulated(exp, plant, fitting_step(sim.step, exp.period), np.random.default_rng(0))
        warm_up, scored = (round(part / exp.period) for part in (WARM_UP, SCORED))
        return pieces(made, exp.robot, exp.period, warm_up=warm_up, scored=scored)

    def _residual(self, one: Pieces, other: Pieces) -> np.ndarray:
        return self.comparison.residual(one.real, other)


def _costs(z: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return what residuals cost after the calibration has been refitted to them, shape (n_joints,)."""
    return projected(z, slopes, np.zeros((len(slopes), z.shape[2])))[1]


def _moved(one: Explanation, row: int, probe: float) -> Explanation:
    """Return an explanation with a probe on one row of its calibration, on none for row -1."""
    nuisances = one.nuisances.copy()
    if row >= 0:
        nuisances[row] += probe
    return Explanation(one.effects, nuisances)


def _rehearsal(found: Findings, records: Sequence[Record], owner: np.ndarray) -> Rehearsal:
    exp, n = found.experiment, len(found.experiment.joints)
    exact = Comparison(np.zeros(n), np.zeros(n, dtype=bool), np.zeros(n))
    own = exp.comparison
    how = Comparison(own.floor[:n], own.shaking[:n], own.sway[:n])
    return Rehearsal(replace(exp, records=tuple(records), comparison=exact), found.simulator, how, owner)


def _commanded(name: str, targets: np.ndarray, robot: Robot) -> Record:
    nothing = np.zeros((0, len(robot.controlled)))
    return Record(name, targets[:, robot.drive], nothing, nothing)
