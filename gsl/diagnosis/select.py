"""Selection: from no effect to as many as the held-out windows bear out, a beam wide, and back by dropping one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gsl.diagnosis import nuisance
from gsl.diagnosis.attribute import BEAM, Arena, Gain, Hypothesis, gain
from gsl.diagnosis.screen import Screening
from gsl.diagnosis.shared import shares
from gsl.effects.effect import TWINS

LEAST_SHARE = 0.2  # of what is left, that a further effect has to explain
MINOR = 0.005  # of what is explained already: less is no cause but a flaw of the model
MUCH = 1.1  # cost of a residual that leaves room for more than a small further effect
NOTHING = 1.0  # cost of a residual that leaves room for none: that of noise is .96
FLAW = 0.005  # of the cost of calibration, that a simulator's own flaws (its time step, say) let any effect gain
HIDDEN = 1.5  # cost of a nuisance, on average, beyond which a calibration hides a cause
NEAR, CHALLENGERS = 0.2, 2  # share of what is explained within which rivals are polished, and how many
APART = 1.5  # spreads by which the mean calibration of a group is off that is a cause's
SHIFTS = (*TWINS, *TWINS.values())
MANY, ASIDE = 4, 4.0  # joints, and standard errors by which their mean zero is off, that are no chance
PAIRS = 5  # leads that are fitted beside an effect that stands already


@dataclass(frozen=True)
class Thresholds:
    """What counts as more than chance, in units of cost.

    Attributes:
        gain: Of an effect over what stands without it.
        share: Of the cost of what stands, that any effect has to explain; noise holds no such share, and is let be.
    """

    gain: float = 20.0
    share: float = 0.0


@dataclass(frozen=True)
class Selection:
    """What attribution came to.

    Attributes:
        none: Calibration without an effect.
        chosen: The hypothesis that stands, maybe `none`.
        tried: All hypotheses, best first, `none` among them.
        screening: The first one; a diagnosis asks once more what is invisible, on top of the chosen hypothesis.
        least: What an effect has to gain in cost here, to be more than chance.
    """

    none: Hypothesis
    chosen: Hypothesis
    tried: tuple[Hypothesis, ...]
    screening: Screening
    least: float = 0.0

    @property
    def gain(self) -> Gain:
        """Of the chosen hypothesis over calibration alone."""
        return gain(self.chosen, self.none)


def selected(
    arena: Arena, thresholds: Thresholds, none: Hypothesis | None = None, *, most: int = 3, width: int = BEAM
) -> Selection:
    """Search for the effects.

    Args:
        arena: Where they compete.
        thresholds: What counts.
        none: Calibration alone, if it is fitted already.
        most: Effects at once.
        width: Single effects that are continued.
    """
    none = none or arena.calibration()
    singles, screening = arena.successors(none)
    tried, chosen = [none, *singles], none
    least = max(thresholds.gain, thresholds.share * none.cost)
    if singles and _stands(singles[0], none, least, FLAW * none.cost):
        chosen = _polished(arena, singles[0], tried) if thresholds.share else singles[0]
        beam, level = _distinct(singles, width), NOTHING
        while len(chosen.candidates) < most:
            lacking = _lacking(arena, chosen, level)
            if not (lacking or _shifted(arena, chosen)):
                break
            where = arena if lacking else arena.only(SHIFTS)
            found = [one for base in beam for one in where.successors(base, PAIRS)[0]]
            tried += found
            better = [one for one in found if _stands(one, chosen, *_bar(thresholds, chosen, none))]
            if not better:
                break
            best = min(better, key=lambda one: one.cost)
            chosen, beam, level = best, [best], MUCH
        chosen = _polished(arena, _pruned(arena, chosen, none, thresholds, tried), tried)
        chosen = _split(arena, chosen, none, thresholds, tried)
        if thresholds.share:
            chosen = _challenged(arena, chosen, none, tried)
        else:
            _rivalled(arena, chosen, tried)
    return Selection(none, chosen, tuple(sorted(tried, key=lambda one: one.cost)), screening, least)


def passed_over(one: Hypothesis, chosen: Hypothesis) -> str | None:
    """Return what speaks against a hypothesis that costs less than the chosen one, None if it costs no less."""
    if one.cost >= chosen.cost or one.places == chosen.places:
        return None
    if gain(one, chosen).low <= 0.0:
        return "not surely better"
    if not one.claims_its_names:
        return "a value beyond its documented range"
    return "little gain for another effect" if len(one.candidates) > len(chosen.candidates) else None


def _stands(one: Hypothesis, other: Hypothesis, least: float, flaw: float) -> bool:
    """Whether a hypothesis is surely better, be it on the residuals beyond a flaw, or by freeing the nuisances.

    Over one with a value beyond its documented range it only has to be better, not surely so: such a value does the
    work of something else.
    """
    found, freed = gain(one, other), other.fit.toll - one.fit.toll
    surely = found.low > 0.0 or (one.claims_its_names and not other.claims_its_names)
    on_residuals = found.value - freed
    beyond = freed + (max(0.0, on_residuals - flaw) if on_residuals > 0.0 else on_residuals)
    return surely and beyond > least


def _bar(thresholds: Thresholds, standing: Hypothesis, none: Hypothesis) -> tuple[float, float]:
    """Return what a further effect has to gain over what stands, and what a flaw of the model may gain."""
    left = max(0.0, standing.cost - float(standing.counts.sum()))
    least = max(thresholds.gain, thresholds.share * standing.cost, LEAST_SHARE * left)
    return least, MINOR * (none.cost - standing.cost)


def _lacking(arena: Arena, standing: Hypothesis, level: float) -> bool:
    """Whether more is left than noise, or hidden in nuisances; the cost of joints that shake does not tell."""
    hides = standing.fit.toll > HIDDEN * standing.fit.nuisances.size
    return standing.level > level or hides or bool(arena.train.comparison.shaking.any())


def _shifted(arena: Arena, standing: Hypothesis) -> bool:
    """Whether the zeros of many joints are off to one side, which those of one make are not."""
    size = arena.train.simulator.spread * np.hypot(*nuisance.SIZES[[nuisance.ZERO, nuisance.OFFSET]])
    off = standing.fit.nuisances[[nuisance.ZERO, nuisance.OFFSET]].sum(axis=0) / size
    scopes = [mask for mask in arena.scopes.values() if mask.sum() >= MANY]
    return any(abs(float(off[mask].sum())) > ASIDE * np.sqrt(mask.sum()) for mask in scopes)


def _distinct(singles: list[Hypothesis], width: int) -> list[Hypothesis]:
    """Return the best hypotheses of different effects, not more than `width`."""
    found: list[Hypothesis] = []
    for one in singles:
        if len(found) < width and one.names not in [other.names for other in found]:
            found.append(one)
    return found


def _pruned(
    arena: Arena, chosen: Hypothesis, none: Hypothesis, thresholds: Thresholds, tried: list[Hypothesis]
) -> Hypothesis:
    """Drop effects that the others can do without, within their documented ranges if that is possible."""
    while len(chosen.candidates) > 1:
        fewer = [_without(arena, chosen, k) for k in range(len(chosen.candidates))]
        tried += fewer
        best = min(fewer, key=lambda one: (chosen.claims_its_names and not one.claims_its_names, one.cost))
        if _stands(chosen, best, *_bar(thresholds, best, none)):
            break
        chosen = best
    return chosen


def _split(
    arena: Arena, chosen: Hypothesis, none: Hypothesis, thresholds: Thresholds, tried: list[Hypothesis]
) -> Hypothesis:
    """Give causes of all joints to the groups apart, where the calibration makes up for what these differ by."""
    size, count = arena.train.simulator.spread * nuisance.SIZES, arena.train.joints
    groups = {name: mask for name, mask in arena.scopes.items() if 1 < mask.sum() < count}
    if not groups or not np.all(np.sum(list(groups.values()), axis=0) == 1):
        return chosen
    for k, candidate in enumerate(chosen.candidates):
        rows = {share.row for share in shares([candidate], arena.scopes) if share.joints.all()}
        means = [chosen.fit.nuisances[row, mask].mean() / size[row] for row in rows for mask in groups.values()]
        if max(map(abs, means), default=0.0) < APART:
            continue
        apart = [candidate.on(name) for name in groups]
        values = [*chosen.parameters[:k], *[chosen.parameters[k]] * len(apart), *chosen.parameters[k + 1 :]]
        candidates = (*chosen.candidates[:k], *apart, *chosen.candidates[k + 1 :])
        one = arena.fitted(candidates, np.concatenate(values), chosen.fit.nuisances, every=1)
        tried.append(one)
        if _stands(one, chosen, *_bar(thresholds, chosen, none)):
            return _pruned(arena, one, none, thresholds, tried)
    return chosen


def _without(arena: Arena, chosen: Hypothesis, k: int) -> Hypothesis:
    rest = [index for index in range(len(chosen.candidates)) if index != k]
    start = np.concatenate([chosen.parameters[index] for index in rest])
    return arena.fitted(tuple(chosen.candidates[index] for index in rest), start, chosen.fit.nuisances)


def lacks(one: Hypothesis, chosen: Hypothesis, k: int) -> bool:
    """Whether a hypothesis has not the chosen one's k-th effect; the same elsewhere it may have if that one has it."""
    effect = chosen.candidates[k].effect
    beside = [(other.effect, other.fixed) for index, other in enumerate(chosen.candidates) if index != k]
    return all(own.effect != effect or (own.effect, own.fixed) in beside for own in one.candidates)


def _rivalled(arena: Arena, chosen: Hypothesis, tried: list[Hypothesis]) -> None:
    """Try in the place of each effect, for which nothing of as many effects was tried, what did best without it."""
    size = len(chosen.candidates)
    for k in range(size):
        without = [one for one in sorted(tried, key=lambda one: one.cost) if lacks(one, chosen, k)]
        others = [
            (candidate, values)
            for one in without
            for candidate, values in zip(one.candidates, one.parameters, strict=True)
            if (candidate.effect, candidate.scope) not in chosen.places
        ]
        if others and not any(len(one.candidates) == size for one in without):
            candidate, values = others[0]
            rest = [index for index in range(size) if index != k]
            candidates = (*(chosen.candidates[index] for index in rest), candidate)
            start = np.concatenate([*(chosen.parameters[index] for index in rest), values])
            tried.append(arena.fitted(candidates, start, chosen.fit.nuisances))


def _challenged(arena: Arena, chosen: Hypothesis, none: Hypothesis, tried: list[Hypothesis]) -> Hypothesis:
    """Polish the nearest rivals too, and return the best: where joints shake costs jump by as much as they differ."""
    names, rivals = [set(chosen.names)], []
    for one in sorted(tried, key=lambda one: one.cost):
        near = one.cost - chosen.cost < NEAR * (none.cost - chosen.cost)
        if near and len(one.candidates) == len(chosen.candidates) and set(one.names) not in names:
            names.append(set(one.names))
            rivals.append(one)
    polished = [_polished(arena, one, tried) for one in rivals[:CHALLENGERS]]
    return min([chosen, *polished], key=lambda one: one.cost)


def _polished(arena: Arena, chosen: Hypothesis, tried: list[Hypothesis]) -> Hypothesis:
    """Fit what stands once more from where it is, with all derivatives taken anew at every step."""
    again = arena.fitted(chosen.candidates, np.concatenate(chosen.parameters), chosen.fit.nuisances, every=1)
    tried.append(again)
    return again if again.fit.cost < chosen.fit.cost else chosen
