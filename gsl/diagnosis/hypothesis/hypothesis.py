"""A hypothesis is a set of effects, fitted with a calibration on training windows and scored on held-out ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.hypothesis.candidates import Candidate, effects_of
from gsl.diagnosis.hypothesis.fit import Fit
from gsl.diagnosis.simulate.in_the_air import Effects

Z95 = 1.96  # standard deviations of a 95 % interval


@dataclass(frozen=True)
class Hypothesis:
    """A set of effects with everything fitted, and what it costs where it was not fitted.

    Attributes:
        candidates: Its effects; empty for calibration alone.
        parameters: Of each effect.
        fit: On the training windows.
        costs: Robust cost of the held-out residuals of each sample of `Pieces.samples`, shape (n_samples,).
        counts: Residuals in each of these, shape (n_samples,).
        levels: Held-out cost of one residual of each joint, see `Comparison.levels`, shape (n_joints,).
    """

    candidates: tuple[Candidate, ...]
    parameters: tuple[np.ndarray, ...]
    fit: Fit
    costs: np.ndarray
    counts: np.ndarray
    levels: np.ndarray

    @property
    def size(self) -> int:
        """Number of effects."""
        return len(self.candidates)

    @property
    def effects(self) -> Effects:
        """As a world's `effects:` mapping."""
        return effects_of(self.candidates, self.parameters)

    @property
    def names(self) -> tuple[str, ...]:
        """Of its effects, in order of selection."""
        return tuple(candidate.effect for candidate in self.candidates)

    @property
    def places(self) -> frozenset[tuple[str, str]]:
        """Its effects and where each acts."""
        return frozenset((candidate.effect, candidate.scope) for candidate in self.candidates)

    @property
    def pairs(self) -> tuple[tuple[Candidate, np.ndarray], ...]:
        """Its effects, each with its parameters."""
        return tuple(zip(self.candidates, self.parameters, strict=True))

    @property
    def start(self) -> np.ndarray:
        """All parameters in one row, as a fit takes them."""
        return np.concatenate([np.zeros(0), *self.parameters])

    def intervals(self, widening: float, scatter: np.ndarray | None = None) -> tuple[np.ndarray, ...]:
        """Return the 95 % interval of the parameters of each effect, within their bounds, shapes (2, p).

        Scatter does not take an interval to or beyond what does nothing: that something is there, the gain has shown.

        Args:
            widening: How much wider than noise alone makes it.
            scatter: Root mean square error of each parameter in logs of a known truth, shape (n_parameters,).
        """
        if not self.size:
            return ()
        noise = np.sqrt(np.maximum(0.0, np.diag(self.fit.covariance))) * widening
        total = noise if scatter is None else np.hypot(noise, scatter)
        ends = np.cumsum([len(values) for values in self.parameters])[:-1]
        parts = zip(self.pairs, np.split(noise, ends), np.split(total, ends), strict=True)
        return tuple(_interval(candidate, values, narrow, wide) for (candidate, values), narrow, wide in parts)

    @property
    def claims_its_names(self) -> bool:
        """Whether all parameters are inside their documented ranges, as far as a fit can tell."""
        return all(candidate.claims_its_name(values) for candidate, values in self.pairs)

    @property
    def residual_cost(self) -> float:
        """Held-out cost without that of the calibration."""
        return float(self.costs.sum())

    @property
    def cost(self) -> float:
        """Held-out cost, that of the calibration included."""
        return self.residual_cost + self.fit.prior_cost

    @property
    def level(self) -> float:
        """Held-out cost of one residual: about 1 where only noise is left."""
        return float(self.costs.sum() / self.counts.sum())

    def lacks(self, chosen: Hypothesis, k: int) -> bool:
        """Whether it has not another one's k-th effect; the same elsewhere it may have if that one has it."""
        effect = chosen.candidates[k].effect
        beside = [(other.effect, other.fixed) for index, other in enumerate(chosen.candidates) if index != k]
        return all(own.effect != effect or (own.effect, own.fixed) in beside for own in self.candidates)


def _interval(candidate: Candidate, values: np.ndarray, noise: np.ndarray, total: np.ndarray) -> np.ndarray:
    low, high = values - Z95 * total, values + Z95 * total
    narrow = values - Z95 * noise, values + Z95 * noise
    low = np.where((low <= candidate.neutral) & (narrow[0] > candidate.neutral), narrow[0], low)
    high = np.where((high >= candidate.neutral) & (narrow[1] < candidate.neutral), narrow[1], high)
    return np.clip([low, high], candidate.bounds[0], candidate.bounds[1])


def by_cost(hypothesis: Hypothesis) -> float:
    """Return the key by which hypotheses are sorted, best first."""
    return hypothesis.cost


@dataclass(frozen=True)
class Gain:
    """How much less one hypothesis costs than another, over held-out samples.

    Attributes:
        value: In units of cost.
        low: Lower 95 % bound by bootstrap over samples.
        high: Upper bound.
    """

    value: float
    low: float
    high: float


def gain(better: Hypothesis, worse: Hypothesis, *, samples: int = 1000, seed: int = 0) -> Gain:
    """Compare two hypotheses sample by sample; the difference of their prior costs is in every sample.

    One sample alone does not say how much a gain varies.
    """
    difference = worse.costs - better.costs
    extra = worse.fit.prior_cost - better.fit.prior_cost
    if len(difference) == 1:
        return Gain(float(difference.sum() + extra), -np.inf, np.inf)
    totals = difference[_resample(len(difference), samples, seed)].sum(axis=1) + extra
    low, high = np.quantile(totals, [0.025, 0.975])
    return Gain(float(difference.sum() + extra), float(low), float(high))


def share_of_excess(
    better: Hypothesis, worse: Hypothesis, none: Hypothesis, least: float, *, samples: int = 1000, seed: int = 0
) -> tuple[float, float, float]:
    """Return a gain as a share of the excess, in [-1, 1], and its 95 % interval by bootstrap over samples.

    Args:
        better: What gains.
        worse: Over which it gains.
        none: What costs the excess: the hypothesis without an effect.
        least: Cost of one residual where only noise is left.
        samples: Of the bootstrap.
        seed: Of the bootstrap.
    """
    index = np.vstack([np.arange(len(none.costs)), _resample(len(none.costs), samples, seed)])
    gains = (worse.costs - better.costs)[index].sum(axis=1) + worse.fit.prior_cost - better.fit.prior_cost
    excess = (none.costs - least * none.counts)[index].sum(axis=1) + none.fit.prior_cost
    value, *rest = np.clip(gains / np.maximum(excess, 1e-9), -1.0, 1.0)
    low, high = np.quantile(rest, [0.025, 0.975])
    return float(value), float(low), float(high)


def _resample(count: int, samples: int, seed: int) -> np.ndarray:
    """Return samples with replacement, as indices of shape (samples, count)."""
    return np.random.default_rng(seed).integers(0, count, (samples, count))


def name_in_place(chosen: Hypothesis, rival: Hypothesis) -> str:
    """Return the effect that a rival has and the chosen hypothesis has not; its last one where it has the same."""
    return next((name for name in rival.names if name not in chosen.names), rival.names[-1])
