"""Looks at a log for what no search over a range would find: a push at one time, and targets of few bits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gsl.core.setting import settings_of
from gsl.diagnosis.hypothesis.candidates import Looks
from gsl.diagnosis.hypothesis.problem import PUSH
from gsl.diagnosis.log.log import Log
from gsl.effects.quantisation import Quantisation

ROUNDING = "quantisation"
RECORDS = 3  # that have to show a push at the same time
HIGH = 9.0  # times the usual power of a joint
TYPICAL = 0.45  # median of the square of a residual that is normal noise
LONGEST = 0.8  # [s]: a push and what rings after it
RINGING = 0.02  # for which a stiff servo is still off afterwards, or swings through where it shall be [s]
STEPS = 400  # roundings that are tried, evenly in their logarithm, twice: a fit finds the right one from very near only
LEAST = 0.1  # share of the documented range below which no log of a robot shows a step
LAG = 0.02  # between a target and what it does to the position, once or twice so much [s], at least a tick


def look(log: Log, z: np.ndarray) -> Looks:
    """Look for pushes and roundings in the residuals of all windows of a log, shape (W, scored, n_channels)."""
    push = find_push(log, z)
    fixed = {PUSH: {"start": push[0], "duration": push[1]}} if push else {}
    return Looks(fixed, {} if log.walking else {ROUNDING: find_rounding(log, z)})


def find_push(log: Log, z: np.ndarray) -> tuple[float, float] | None:
    """Return when residuals are high at one time of most records and not elsewhere: start and duration [s].

    Somebody pushes then, or a cable pulls, whatever is commanded.

    Args:
        log: The log.
        z: Residuals of all windows with everything else fitted, in units of the floor, shape (W, scored, n_joints).
    """
    power = np.minimum(z[..., ~log.comparison.shaking] ** 2, 100.0)  # the rows of a joint that shakes are no ticks
    if not power.shape[2]:
        return None
    pieces = log.pieces
    own = {record: np.median(power[pieces.record == record], axis=(0, 1)) for record in set(pieces.record)}
    by_tick: dict[int, list[np.ndarray]] = {}
    for window, record, first in zip(power, pieces.record, pieces.tick, strict=True):
        for k, values in enumerate(window / np.maximum(own[record], TYPICAL)):
            by_tick.setdefault(int(first) + pieces.warm_up + 1 + k, []).append(values)
    typical = {tick: np.median(values, axis=0).max() for tick, values in by_tick.items() if len(values) >= RECORDS}
    high = sorted(tick for tick, power_then in typical.items() if power_then > HIGH)
    run = _longest_run(high, max(1, round(RINGING / log.period)))
    length = len(run) * log.period
    if len(run) < 2 or length > LONGEST or len(run) < 0.5 * len(high):
        return None
    return (run[0] - 1) * log.period, max(log.period, length - RINGING)


def _longest_run(ticks: Sequence[int], gap: int) -> list[int]:
    """Return the longest run of ticks, with such gaps as a deviation that swings through zero leaves."""
    best: list[int] = []
    run: list[int] = []
    for tick in ticks:
        run = [*run, tick] if run and tick - run[-1] <= 1 + gap else [tick]
        best = run if len(run) > len(best) else best
    return best


def find_rounding(log: Log, z: np.ndarray) -> float:
    """Return the step of targets [rad] whose rounding goes best with what is left of a log in the air.

    Args:
        log: The log.
        z: Residuals of all windows with everything else fitted, in units of the floor, shape (W, scored, n_joints).
    """
    most = settings_of(Quantisation)["step"].upper or 0.0
    targets = log.pieces.targets(len(log.joints))
    left = np.where(log.comparison.shaking, 0.0, -np.clip(z, -5.0, 5.0))  # whose rows are no ticks if it shakes
    lags = [times * max(1, round(LAG / log.period)) for times in (1, 2)]
    best, width = most * np.sqrt(LEAST), np.sqrt(1.0 / LEAST)
    for _ in range(2):
        steps = best * np.geomspace(1.0 / width, width, STEPS)
        best = steps[np.argmax([_agreement(step * np.rint(targets / step) - targets, left, lags) for step in steps])]
        width = width ** (4.0 / STEPS)
    return float(min(best, most))


def _agreement(rounded: np.ndarray, left: np.ndarray, lags: Sequence[int]) -> float:
    """Return the share of what is left, shape (W, scored, n_joints), that goes with a rounding, shape (W, T, n)."""
    first = rounded.shape[1] - left.shape[1]
    lagged = [rounded[:, first - lag + 1 : rounded.shape[1] - lag + 1] for lag in lags]
    mean = np.mean(lagged, axis=0)
    return float((mean * left).sum() / np.sqrt((mean**2).sum() + 1e-12))
