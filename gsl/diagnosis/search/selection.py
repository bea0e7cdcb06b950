"""What a search came to, and what a hypothesis has to gain to stand against another one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.hypothesis.hypothesis import Hypothesis, gain
from gsl.diagnosis.options import Chance
from gsl.diagnosis.search.screening import Screening
from gsl.diagnosis.settings import SearchSettings


@dataclass(frozen=True)
class Thresholds:
    """What counts as more than chance, in units of cost.

    Attributes:
        gain: Of an effect over what stands without it.
        freed: Of the cost of shifts, that an effect may free instead.
        share: Of the cost of what stands, that any effect has to explain; noise holds no such share, and is let be.
    """

    gain: float = SearchSettings.gain
    freed: float = SearchSettings.freed
    share: float = 0.0

    @classmethod
    def of(cls, chances: Sequence[Chance], how: SearchSettings, share: float) -> Thresholds:
        """Return what has to be gained where chance gains so much; by freeing shifts nothing is, where costs vary."""
        gain = how.chance * max((chance.gain for chance in chances), default=0.0)
        freed = how.chance * max((chance.freed for chance in chances), default=0.0)
        return cls(max(how.gain, gain), np.inf if share else max(how.freed, freed), share)


@dataclass(frozen=True)
class Selection:
    """What a search came to.

    Attributes:
        none: Calibration without an effect.
        chosen: The hypothesis that stands, maybe `none`.
        tried: All hypotheses, best first, `none` among them.
        screening: The first one; a diagnosis asks once more what is invisible, on top of the chosen hypothesis.
        least: What an effect has to gain in cost here, to be more than chance.
        freed: What it has to free of the cost of shifts instead.
        rejected: Single effects that cost less than the first that stands, and do not stand themselves.
    """

    none: Hypothesis
    chosen: Hypothesis
    tried: tuple[Hypothesis, ...]
    screening: Screening
    least: float = 0.0
    freed: float = SearchSettings.freed
    rejected: tuple[Hypothesis, ...] = ()

    @property
    def rivals(self) -> tuple[Hypothesis, ...]:
        """All that may stand in the chosen one's place, best first."""
        return tuple(fit for fit in self.tried if not any(fit is other for other in self.rejected))

    def objection(self, hypothesis: Hypothesis) -> str | None:
        """Return what speaks against a hypothesis that costs less than the chosen one, None if it costs no less."""
        if hypothesis.cost >= self.chosen.cost or hypothesis.places == self.chosen.places:
            return None
        if any(hypothesis is other for other in self.rejected):
            return "not significantly better than a calibration"
        if gain(hypothesis, self.chosen).low <= 0.0:
            return "not significantly better"
        if not hypothesis.claims_its_names:
            return "a value beyond its documented range"
        return "little gain for another effect" if hypothesis.size > self.chosen.size else None


def stands(hypothesis: Hypothesis, other: Hypothesis, least: float, flaw: float, freed: float = np.inf) -> bool:
    """Whether a hypothesis is significantly better, on the residuals beyond a flaw or by freeing the shifts.

    Over one with a value beyond its documented range it only has to be better, not significantly so: such a value does
    the work of something else.

    Args:
        hypothesis: That may stand.
        other: In whose place.
        least: What it has to gain.
        flaw: Of the model, that counts for nothing.
        freed: Or what it has to free of the cost of shifts alone, whatever chance gains on residuals.
    """
    better, frees = gain(hypothesis, other), other.fit.prior_cost - hypothesis.fit.prior_cost
    surely = better.low > 0.0 or (hypothesis.claims_its_names and not other.claims_its_names)
    on_residuals = better.value - frees
    beyond = frees + (max(0.0, on_residuals - flaw) if on_residuals > 0.0 else on_residuals)
    return surely and (beyond > least or min(beyond, frees) > freed)
