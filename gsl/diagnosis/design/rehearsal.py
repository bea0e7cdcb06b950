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
from gsl.diagnosis.design.motions import Choice
from gsl.diagnosis.hypothesis.fit import fit_shifts
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.log.records import Pieces, Record, cut_pieces
from gsl.diagnosis.log.residual import Comparison
from gsl.diagnosis.settings import DesignSettings
from gsl.diagnosis.simulate.calibration import PROBES
from gsl.diagnosis.simulate.in_the_air import Effects, change
from gsl.diagnosis.simulate.simulator import Simulator
from gsl.diagnosis.verdict.findings import Findings
from gsl.diagnosis.verdict.self_test import relog
from gsl.worlds.fits import fitting_step


class Explanation(NamedTuple):
    """Effects and the calibration, shape (7, n_joints), that go with them."""

    effects: Effects
    shifts: np.ndarray


class Rival(NamedTuple):
    """What an explanation would log from several starts, and how that changes with its calibration.

    `slopes` are each of shape (7, W, scored, n_joints).
    """

    starts: tuple[Explanation, ...]
    bases: tuple[Pieces, ...]
    slopes: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class Rehearsal:
    """Where motions in the air are tried out; a motion is one record or several.

    Attributes:
        log: With the records, of which only the commands count.
        simulator: The user's.
        comparison: How joints are compared.
        owner: Number of each record's motion, shape (n_records,).
        threads: That simulate logs side by side.
    """

    log: Log
    simulator: Simulator
    comparison: Comparison
    owner: np.ndarray
    threads: int = DesignSettings.threads
    _ready: dict[int, Rival] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def of(cls, findings: Findings, choices: Sequence[Choice]) -> Rehearsal:
        """Prepare the rehearsal of motions, of each the first variant, for what a diagnosis left open."""
        robot = findings.log.robot
        records = [_command(*choice.variants[0], robot) for choice in choices]
        return cls._prepare(findings, records, np.arange(len(choices)))

    @classmethod
    def again(cls, findings: Findings) -> Rehearsal:
        """Prepare to go through the diagnosed log in the air once more, all of it as one motion."""
        records = [replace(record, base=None) for record in findings.log.records]
        return cls._prepare(findings, records, np.zeros(len(records), dtype=int))

    @classmethod
    def _prepare(cls, findings: Findings, records: Sequence[Record], owner: np.ndarray) -> Rehearsal:
        log, n = findings.log, len(findings.log.joints)
        own = log.comparison
        how = Comparison(own.floor[:n], own.shaking[:n], own.sway[:n], own.carried[:n])
        exact = replace(log, records=tuple(records), comparison=Comparison.plain(np.zeros(n)))
        return cls(exact, findings.simulator, how, owner, findings.options.design.threads)

    def log_odds(self, truth: Explanation, rivals: tuple[Explanation, ...], *, loose: float = 1.0) -> np.ndarray:
        """Return how far each motion is expected to speak for the truth, natural logarithm, shape (n_motions,).

        Args:
            truth: What makes the log.
            rivals: What has to explain it, refitted to it from whichever of these starts suits a joint best.
            loose: How far the rivals' calibration may go, in its usual spread.
        """
        if id(rivals) not in self._ready:
            self._ready[id(rivals)] = self._against(rivals)
        rival, logged = self._ready[id(rivals)], self.simulate(truth)
        owner, motions = self.owner[logged.record], range(self.owner.max() + 1)
        lost = np.full(logged.real.shape[2], np.inf)  # nothing explains a robot that runs away
        away = set(owner[~np.isfinite(logged.real).all(axis=(1, 2))].tolist())
        costs = []
        for base, slopes in zip(rival.bases, rival.slopes, strict=True):
            z = self._residual(logged, base)
            parts = ((k, owner == k) for k in motions)
            costs.append([lost if k in away else _costs(z[part], loose * slopes[:, part]) for k, part in parts])
        odds: np.ndarray = 0.5 * np.min(costs, axis=0).sum(axis=1)
        return odds

    def _against(self, rivals: tuple[Explanation, ...]) -> Rival:
        probes = ((-1, 1.0), *enumerate(PROBES))
        with ThreadPoolExecutor(self.threads) as pool:
            logs = list(pool.map(self.simulate, [_move(rival, *probe) for rival in rivals for probe in probes]))
        bases, slopes = logs[:: len(probes)], []
        for k, base in enumerate(bases):
            moved = logs[k * len(probes) + 1 : (k + 1) * len(probes)]
            pairs = zip(moved, PROBES, strict=True)
            slopes.append(np.array([self._residual(pieces, base) / probe for pieces, probe in pairs]))
        return Rival(rivals, tuple(bases), tuple(slopes))

    def simulate(self, truth: Explanation) -> Pieces:
        """Return what would be logged, without noise."""
        log, how = self.log, self.log.settings
        step = fitting_step(self.simulator.log_step, log.period)
        plant = change(self.simulator.plant, truth.effects, truth.shifts)
        records = relog(log, plant, step, np.random.default_rng(0))
        warm_up, scored = (round(part / log.period) for part in (how.warm_up, how.scored))
        return cut_pieces(records, log.robot, log.period, warm_up=warm_up, scored=scored)

    def _residual(self, pieces: Pieces, other: Pieces) -> np.ndarray:
        return self.comparison.residual(pieces.real, other)


def _costs(z: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return what residuals cost after the calibration has been refitted to them, shape (n_joints,)."""
    return fit_shifts(z, slopes, np.zeros((len(slopes), z.shape[2])))[1]


def _move(explanation: Explanation, row: int, probe: float) -> Explanation:
    """Return an explanation with a probe on one row of its calibration, on none for row -1."""
    shifts = explanation.shifts.copy()
    if row >= 0:
        shifts[row] += probe
    return Explanation(explanation.effects, shifts)


def _command(name: str, targets: np.ndarray, robot: Robot) -> Record:
    nothing = np.zeros((0, len(robot.controlled)))
    return Record(name, targets[:, robot.drive], nothing, nothing)
