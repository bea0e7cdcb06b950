"""Means, shares, medians, rank correlations and concordances of a handful of numbers, with intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import scipy  # scipy.stats takes longer to load than most commands run: only what needs it asks for it


class Interval(NamedTuple):
    """A mean with its two-sided confidence interval; the bounds are infinite where one value is all there is."""

    mean: float
    lower: float
    upper: float


def mean_interval(values: Sequence[float] | np.ndarray, *, confidence: float = 0.95) -> Interval:
    """Return the mean of independent values, shape (n,), with Student's t interval."""
    values = np.asarray(values, dtype=float)
    return _t_interval(
        values.mean(), values.var(ddof=1) / len(values) if len(values) > 1 else np.inf, len(values) - 1, confidence
    )


def difference_interval(
    after: np.ndarray, before: np.ndarray, *, confidence: float = 0.95, pooled: bool = False
) -> Interval:
    """Return mean(after) - mean(before) of two independent samples with Welch's t interval.

    Args:
        after: Shape (n,).
        before: Shape (m,).
        confidence: Of the interval.
        pooled: Whether one variance is taken to be both's (Student's interval).
    """
    after, before = np.asarray(after, dtype=float), np.asarray(before, dtype=float)
    difference = after.mean() - before.mean()
    if min(len(after), len(before)) < 2:
        return Interval(float(difference), -np.inf, np.inf)
    counts, variances = np.array([len(after), len(before)]), np.array([after.var(ddof=1), before.var(ddof=1)])
    if pooled:
        variance = np.average(variances, weights=counts - 1)
        return _t_interval(difference, variance * np.sum(1.0 / counts), counts.sum() - 2, confidence)
    shares = variances / counts
    if shares.sum() == 0.0:
        return Interval(float(difference), float(difference), float(difference))
    freedom = shares.sum() ** 2 / np.sum(shares**2 / (counts - 1))
    return _t_interval(difference, shares.sum(), freedom, confidence)


def wilson(hits: int, count: int, *, confidence: float = 0.95) -> Interval:
    """Return the share of hits with Wilson's score interval (Wilson 1927)."""
    z, share = scipy.special.ndtri(0.5 + confidence / 2), hits / count
    centre = (share + z**2 / (2 * count)) / (1.0 + z**2 / count)
    half = z / (1.0 + z**2 / count) * np.sqrt(share * (1.0 - share) / count + z**2 / (4 * count**2))
    return Interval(share, float(max(0.0, centre - half)), float(min(1.0, centre + half)))


def quantile_interval(values: Sequence[float] | np.ndarray, *, confidence: float = 0.95) -> Interval:
    """Return the median of independent values, shape (n,), with the interval of order statistics that holds it."""
    ordered, n = np.sort(np.asarray(values, dtype=float)), len(values)
    outside = int(scipy.stats.binom.ppf((1.0 - confidence) / 2, n, 0.5))
    low, high = max(0, outside - 1), min(n - 1, n - outside)
    return Interval(float(np.median(ordered)), float(ordered[low]), float(ordered[high]))


def concordance(figures: Sequence[float], outcomes: Sequence[float]) -> float:
    """Return how often the larger figure goes with the larger outcome, of pairs whose outcomes differ; NaN if none do.

    Both have the shape (n,); equal figures count half. It is Harrell's c, and of two outcomes the area under the ROC
    curve.
    """
    x, y = np.asarray(figures, dtype=float), np.asarray(outcomes, dtype=float)
    apart = y[:, None] > y[None, :]
    larger = (x[:, None] > x[None, :]) + 0.5 * (x[:, None] == x[None, :])
    return float(larger[apart].mean()) if apart.any() else np.nan


def rank_correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Return Spearman's rho of two samples of equal length, NaN if one of them does not vary."""
    if np.ptp(first) == 0.0 or np.ptp(second) == 0.0:
        return np.nan
    return float(scipy.stats.spearmanr(first, second).statistic)


def bootstrap_interval(
    statistic: Callable[[np.ndarray], float],
    count: int,
    rng: np.random.Generator,
    *,
    confidence: float = 0.95,
    samples: int = 1000,
) -> Interval:
    """Return a statistic of `count` things with its percentile interval over things drawn again (Efron 1979).

    Args:
        statistic: Of the things with these indices, shape (count,); draws for which it is NaN are left out.
        count: How many things there are.
        rng: Draws them.
        confidence: Of the two-sided interval.
        samples: How often they are drawn.
    """
    drawn = np.array([statistic(rng.integers(count, size=count)) for _ in range(samples)])
    drawn = drawn[np.isfinite(drawn)]
    tails = (1.0 - confidence) / 2
    low, high = np.quantile(drawn, [tails, 1.0 - tails]) if len(drawn) else (-np.inf, np.inf)
    return Interval(float(statistic(np.arange(count))), float(low), float(high))


def _t_interval(mean: float, variance_of_mean: float, freedom: float, confidence: float) -> Interval:
    if not np.isfinite(variance_of_mean):
        return Interval(float(mean), -np.inf, np.inf)
    half = scipy.special.stdtrit(freedom, 0.5 + confidence / 2) * np.sqrt(variance_of_mean)
    return Interval(float(mean), float(mean - half), float(mean + half))
