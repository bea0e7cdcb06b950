"""Walks beside motions in the air: windows on the ground, replayed in Bullet with a learned servo.

Feet load joints as no motion in the air does. Gradients know no contact, so walks say what a servo's numbers are, by
least squares, and lags and network stay with the motions in the air.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsl.core.body import Robot
from gsl.core.plant import Plant
from gsl.core.trajectory import Batch
from gsl.diagnosis.log.log import Log, cut_log
from gsl.diagnosis.simulate.on_ground import Walking, model_error
from gsl.errors import InputError
from gsl.models.servo import ServoModel
from gsl.worlds.fits import fitting_step

WINDOWS = 48  # that are fitted, at most: a replay of one takes milliseconds
ERRORS = 40  # windows that measure what a log does not show of a walk


@dataclass(frozen=True)
class Walks:
    """A log on the ground, and what replays it.

    Attributes:
        exp: The log, its floor widened by what it does not show: contact forces, the friction's state.
        simulator: The robot that the servo stands on.
    """

    exp: Log
    simulator: Walking

    @property
    def train(self) -> np.ndarray:
        """Indices of the windows that are fitted, spread over all that may be, shape (W,)."""
        some = self.exp.train
        return some[np.unique(np.linspace(0, len(some) - 1, min(WINDOWS, len(some))).round().astype(int))]

    def residuals(self, index: np.ndarray, model: ServoModel) -> np.ndarray:
        """Return the joints' residuals of some windows [floors], shape (W, scored, n_joints).

        Args:
            index: Of the windows, shape (W,).
            model: The servo.
        """
        some = self.exp.pieces.take(index)
        simulator = Walking(
            model.on(self.simulator.plant), self.simulator.step, self.simulator.period, workers=self.simulator.workers
        )
        replayed = simulator.simulate({}, np.zeros(0), some)
        return self.exp.comparison.residual(replayed, some)[..., : len(self.exp.joints)]

    def level(self, model: ServoModel) -> float:
        """Return the root mean square of the residuals of held-out windows [floors]."""
        return float(np.sqrt(np.mean(self.residuals(self.exp.held_out, model) ** 2)))


def walks(batch: Batch, robot: Robot, plant: Plant, step: float, workers: int) -> Walks:
    """Return walks ready for a fit.

    Args:
        batch: The log, checked.
        robot: Whose log it is, without fixed joints.
        plant: The robot that the servo stands on.
        step: Physics period of the simulator [s].
        workers: Processes that replay side by side.

    Raises:
        GslError: No walk is long enough for a window, or they are too few to fit and to check.
    """
    exp = cut_log(batch, robot, walking=True)
    if not len(exp.train) or not len(exp.held_out):
        raise InputError("the walks are too few to fit and to check: two of some seconds are the least")
    simulator = Walking(plant, fitting_step(step, exp.period), exp.period, workers=workers)
    some = exp.pieces.take(np.arange(0, len(exp.pieces), max(1, len(exp.pieces) // ERRORS)))
    error = model_error(simulator, some, np.random.default_rng(0))
    return Walks(exp.with_model_error(error), simulator)
