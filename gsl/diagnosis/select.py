"""Selection: from no effect to as many as the held-out windows bear out, a beam wide, and back by dropping one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.attribute import BEAM, Arena, Gain, Hypothesis, gain
from gsl.diagnosis.screen import Screening

LEAST_SHARE = 0.2  # of what is left, that a further effect has to explain
MUCH = 1.1  # cost of a residual that leaves room for more than a small further effect
PAIRS = 5  # leads that are fitted beside an effect that stands already


@dataclass(frozen=True)
class Thresholds:
    """What counts as more than chance, in units of cost.

    Attributes:
        gain: Of a first effect over calibration alone.
        further: Of a further effect.
        share: Of the cost of what stands, that any effect has to explain; noise holds no such share, and is let be.
    """

    gain: float = 20.0
    further: float = 20.0
    share: float = 0.0


@dataclass(frozen=True)
class Selection:
    """What attribution came to.

    Attributes:
        none: Calibration without an effect.
        chosen: The hypothesis that stands, maybe `none`.
        tried: All hypotheses, best first, `none` among them.
        screening: The first one.
    """

    none: Hypothesis
    chosen: Hypothesis
    tried: tuple[Hypothesis, ...]
    screening: Screening

    @property
    def gain(self) -> Gain:
        """Of the chosen hypothesis over calibration alone."""
        return gain(self.chosen, self.none)


def selected(arena: Arena, thresholds: Thresholds, none: Hypothesis | None = None, *, most: int = 3) -> Selection:
    """Search for the effects.

    Args:
        arena: Where they compete.
        thresholds: What counts.
        none: Calibration alone, if it is fitted already.
        most: Effects at once.
    """
    none = none or arena.calibration()
    singles, screening = arena.successors(none)
    tried, chosen = [none, *singles], none
    if singles and _stands(singles[0], none, max(thresholds.gain, thresholds.share * none.cost)):
        chosen = _polished(arena, singles[0], tried) if thresholds.share else singles[0]
        beam = _distinct(singles)[: BEAM if _lacking(chosen) else 1]
        while len(chosen.candidates) < most and (_lacking(chosen) or not thresholds.share):
            found = [one for base in beam for one in arena.successors(base, PAIRS)[0]]
            tried += found
            best = min(found, key=lambda one: one.cost, default=chosen)
            if not _stands(best, chosen, _least(thresholds, chosen)):
                break
            chosen, beam = best, [best]
            if not _lacking(chosen):
                break
        chosen = _polished(arena, _pruned(arena, chosen, thresholds, tried), tried)
    return Selection(none, chosen, tuple(sorted(tried, key=lambda one: one.cost)), screening)


def _stands(one: Hypothesis, other: Hypothesis, least: float) -> bool:
    found = gain(one, other)
    return found.value > least and found.low > 0.0


def _least(thresholds: Thresholds, standing: Hypothesis) -> float:
    """Return what a further effect has to gain over what stands."""
    floor = max(thresholds.further, thresholds.share * standing.cost)
    return max(floor, LEAST_SHARE * max(0.0, standing.cost - float(standing.counts.sum())))


def _lacking(standing: Hypothesis) -> bool:
    """Whether much more is left than noise."""
    return standing.level > MUCH


def _distinct(singles: list[Hypothesis]) -> list[Hypothesis]:
    """Return the best hypotheses of different effects, BEAM of them."""
    found: list[Hypothesis] = []
    for one in singles:
        if len(found) < BEAM and one.names not in [other.names for other in found]:
            found.append(one)
    return found


def _pruned(arena: Arena, chosen: Hypothesis, thresholds: Thresholds, tried: list[Hypothesis]) -> Hypothesis:
    """Drop effects that the others can do without."""
    while len(chosen.candidates) > 1:
        fewer = [_without(arena, chosen, k) for k in range(len(chosen.candidates))]
        tried += fewer
        best = min(fewer, key=lambda one: one.cost)
        if _stands(chosen, best, _least(thresholds, best)):
            break
        chosen = best
    return chosen


def _without(arena: Arena, chosen: Hypothesis, k: int) -> Hypothesis:
    rest = [index for index in range(len(chosen.candidates)) if index != k]
    start = np.concatenate([chosen.parameters[index] for index in rest])
    return arena.fitted(tuple(chosen.candidates[index] for index in rest), start, chosen.fit.nuisances)


def _polished(arena: Arena, chosen: Hypothesis, tried: list[Hypothesis]) -> Hypothesis:
    """Fit what stands once more from where it is, with all derivatives taken anew at every step."""
    again = arena.fitted(chosen.candidates, np.concatenate(chosen.parameters), chosen.fit.nuisances)
    best = again if again.fit.cost < chosen.fit.cost else chosen
    tried.append(best)
    return best
