"""A deviation that comes at one time of every episode, whatever is commanded: somebody pushes, or a cable pulls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gsl.diagnosis.experiment import Experiment

LEAST = 3  # records that have to show it at the same time
HIGH = 9.0  # times the usual power of a joint
TYPICAL = 0.45  # median of the square of a residual that is noise
LONGEST = 0.8  # [s]: a push and what rings after it
RINGING = 0.02  # for which a stiff servo is still off afterwards [s]


class Transient(NamedTuple):
    """When something happens in every episode, from its start [s]."""

    start: float
    duration: float


def transient(found: Experiment, z: np.ndarray) -> Transient | None:
    """Return when residuals are high at one time of most records and not elsewhere, None if they are not.

    Args:
        found: The log.
        z: Residuals of all windows with everything else fitted, in units of the floor, shape (W, scored, n_joints).
    """
    power = np.minimum(z[..., ~found.comparison.shaking] ** 2, 100.0)  # the rows of a joint that shakes are no ticks
    if not power.shape[2]:
        return None
    own = {record: np.median(power[found.pieces.record == record], axis=(0, 1)) for record in set(found.pieces.record)}
    by_tick: dict[int, list[np.ndarray]] = {}
    for window, record, first in zip(power, found.pieces.record, found.pieces.tick, strict=True):
        for k, values in enumerate(window / np.maximum(own[record], TYPICAL)):
            by_tick.setdefault(int(first) + found.pieces.warm_up + 1 + k, []).append(values)
    seen = {tick: np.median(values, axis=0).max() for tick, values in by_tick.items() if len(values) >= LEAST}
    high = sorted(tick for tick, power_then in seen.items() if power_then > HIGH)
    run = _longest(high)
    length = len(run) * found.period
    if len(run) < 2 or length > LONGEST or len(run) < 0.5 * len(high):
        return None
    return Transient((run[0] - 1) * found.period, max(found.period, length - RINGING))


def _longest(ticks: Sequence[int]) -> list[int]:
    """Return the longest run of ticks, gaps of one allowed, which a deviation that swings through zero leaves."""
    best: list[int] = []
    run: list[int] = []
    for tick in ticks:
        run = [*run, tick] if run and tick - run[-1] <= 2 else [tick]
        best = run if len(run) > len(best) else best
    return best
