"""What is taken out of a log first: the nominal as a reference log has it, and a shift between two clocks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gsl.core.plant import Plant
from gsl.diagnosis.hypothesis.hypothesis import by_cost
from gsl.diagnosis.hypothesis.problem import LATENCY, Ask, Problem
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.options import Options
from gsl.diagnosis.search.selection import Thresholds
from gsl.diagnosis.search.stepwise import Search
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.in_the_air import Effects, change
from gsl.diagnosis.simulate.simulator import simulator_of


class Nominal(NamedTuple):
    """The simulator as the user has it: its plant and its physics period [s]."""

    plant: Plant
    step: float

    def problem(self, log: Log, options: Options, tick: Callable[[str], None]) -> Problem:
        """Return where hypotheses on a log compete."""
        simulator = simulator_of(log, self.plant, self.step, threads=options.threads, spread=options.spread)
        return Problem.of(log, simulator, options, tick)


@dataclass(frozen=True)
class Baseline:
    """The nominal as a reference log has it.

    Attributes:
        effects: Which the reference shows already.
        shifts: Calibration, shape (7, n_joints).
        error: What is left of the model's error [rad], shape (n_joints,).
    """

    effects: Effects
    shifts: np.ndarray
    error: np.ndarray

    def take_out(self, log: Log, nominal: Nominal, options: Options) -> tuple[Log, Nominal, Options]:
        """Return a log of the same robot, the simulator and the options with what the reference shows."""
        plant = change(nominal.plant, self.effects, self.shifts)
        return (
            log.with_model_error(self.error),
            nominal._replace(plant=plant),
            replace(options, spread=options.search.same_robot),
        )


def calibrate_on(reference: Log, nominal: Nominal, options: Options, tick: Callable[[str], None]) -> Baseline:
    """Fit the nominal to a log without the effect: whatever is in it belongs to the nominal from now on."""
    problem = nominal.problem(reference, options, tick)
    search = Search(problem, problem.fit_calibration(), Thresholds(options.search.gain), options.most, width=1)
    chosen = search.select().chosen
    z = problem.held_out.residual(chosen.effects, chosen.fit.shifts)
    left = np.sqrt(np.maximum(0.0, np.mean(np.minimum(z**2, 25.0), axis=(0, 1)) - 1.0))
    return Baseline(chosen.effects, chosen.fit.shifts, left * reference.comparison.floor)


def clock_shift(log: Log, nominal: Nominal, options: Options, tick: Callable[[str], None]) -> float:
    """Return by how much measurements lag behind commands [s], as far as a pure shift explains it."""
    problem = nominal.problem(log, replace(options, clocks=True, without=()), tick)
    candidate = next(part for part in problem.library if part.effect == LATENCY)
    still = no_shifts(problem.train.joints)
    fits = problem.fit_all([Ask((candidate,), np.array([start]), still) for start in options.search.clock_starts])
    return float(min(fits, key=by_cost).parameters[0][0])
