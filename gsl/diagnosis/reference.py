"""What is taken out of a log first: the nominal as a reference log has it, and a shift between two clocks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gsl.core.body import Robot
from gsl.core.plant import Plant
from gsl.core.trajectory import Batch
from gsl.diagnosis import nuisance
from gsl.diagnosis.arena import LATENCY, arena_of
from gsl.diagnosis.experiment import Experiment, experiment
from gsl.diagnosis.options import Options
from gsl.diagnosis.replay import Effects
from gsl.diagnosis.select import Thresholds, selected
from gsl.effects.effect import applied, built

SAME = 0.3  # of the usual spread: by how much the calibration of one robot may change from a reference to its log
SHIFTS = (0.002, 0.02, 0.05)  # where a fit of two clocks' shift starts [s]


@dataclass(frozen=True)
class Baseline:
    """The nominal as a reference log has it.

    Attributes:
        effects: Which the reference shows already.
        nuisances: Shape (7, n_joints).
        error: What is left of the model's error [rad], shape (n_joints,).
    """

    effects: Effects
    nuisances: np.ndarray
    error: np.ndarray

    def taken_out(self, found: Experiment, plant: Plant, options: Options) -> tuple[Experiment, Plant, Options]:
        """Return a log of the same robot, the simulator and the options with what the reference has told."""
        plant = nuisance.calibrated(applied(plant, built(self.effects)), self.nuisances)
        return found.with_model_error(self.error), plant, replace(options, spread=SAME)


def calibrated_on(
    reference: Batch, robot: Robot, plant: Plant, step: float, options: Options, tick: Callable[[str], None]
) -> Baseline:
    """Fit the nominal to a log without the effect: whatever is found there belongs to the nominal from now on."""
    found = experiment(reference, robot)
    arena = arena_of(found, plant, step, options, tick)
    chosen = selected(arena, Thresholds(), most=options.most, width=1).chosen
    z = arena.held_out.residual(chosen.effects, chosen.fit.nuisances)
    left = np.sqrt(np.maximum(0.0, np.mean(np.minimum(z**2, 25.0), axis=(0, 1)) - 1.0))
    return Baseline(chosen.effects, chosen.fit.nuisances, left * found.comparison.floor)


def clock_shift(found: Experiment, plant: Plant, step: float, options: Options, tick: Callable[[str], None]) -> float:
    """Return by how much measurements lag behind commands [s], as far as a pure shift explains it."""
    arena = arena_of(found, plant, step, replace(options, clocks=True, without=()), tick)
    candidate = next(one for one in arena.library if one.effect == LATENCY)
    still = nuisance.none(arena.train.joints)
    fits = [arena.fitted((candidate,), np.array([start]), still) for start in SHIFTS]
    return float(min(fits, key=lambda one: one.cost).parameters[0][0])
