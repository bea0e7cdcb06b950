"""A look at the log for targets of few bits: what is left of it follows what rounding them would do."""

from __future__ import annotations

import numpy as np

from gsl.core.setting import settings_of
from gsl.diagnosis.experiment import Experiment
from gsl.effects.quantisation import Quantisation

STEPS = 400  # that are tried, evenly in their logarithm, twice: a fit finds the right one only from very near by
LEAST = 0.1  # share of the documented range below which no log of a robot shows a step
LAGS = (1, 2)  # ticks between a target and what it does to the position


def staircase(found: Experiment, z: np.ndarray) -> float:
    """Return the step of targets [rad] whose rounding goes best with what is left of the log.

    Args:
        found: The log, in the air.
        z: Residuals of all windows with everything else fitted, in units of the floor, shape (W, scored, n_joints).
    """
    most = settings_of(Quantisation)["step"].upper or 0.0
    n, length = len(found.joints), found.pieces.real.shape[1]
    targets = found.pieces.windows.commands[:, :length, :n][:, ::-1]
    left = np.where(found.comparison.shaking, 0.0, -np.clip(z, -5.0, 5.0))  # whose rows are no ticks if it shakes
    best, width = most * np.sqrt(LEAST), np.sqrt(1.0 / LEAST)
    for _ in range(2):
        steps = best * np.geomspace(1.0 / width, width, STEPS)
        best = steps[np.argmax([_agreement(step * np.rint(targets / step) - targets, left) for step in steps])]
        width = width ** (4.0 / STEPS)
    return float(min(best, most))


def _agreement(rounded: np.ndarray, left: np.ndarray) -> float:
    """Return the share of what is left, shape (W, scored, n_joints), that goes with a rounding, shape (W, T, n)."""
    first = rounded.shape[1] - left.shape[1]
    lagged = [rounded[:, first - lag + 1 : rounded.shape[1] - lag + 1] for lag in LAGS]
    mean = np.mean(lagged, axis=0)
    return float((mean * left).sum() / np.sqrt((mean**2).sum() + 1e-12))
