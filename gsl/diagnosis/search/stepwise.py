"""Stepwise selection: from no effect to as many as the held-out windows bear out, and back by dropping one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gsl.diagnosis.hypothesis.common_mode import shares
from gsl.diagnosis.hypothesis.hypothesis import Gain, Hypothesis, by_cost, gain
from gsl.diagnosis.hypothesis.problem import Problem
from gsl.diagnosis.search.screening import Screening, extend, screen
from gsl.diagnosis.search.zeros import SHIFTS, explains_zeros, moves_zeros_alone, zeros_aside
from gsl.diagnosis.settings import SearchSettings
from gsl.diagnosis.simulate.calibration import SPREADS


@dataclass(frozen=True)
class Thresholds:
    """What counts as more than chance, in units of cost.

    Attributes:
        gain: Of an effect over what stands without it.
        share: Of the cost of what stands, that any effect has to explain; noise holds no such share, and is let be.
    """

    gain: float = SearchSettings.gain
    share: float = 0.0


@dataclass(frozen=True)
class Selection:
    """What a search came to.

    Attributes:
        none: Calibration without an effect.
        chosen: The hypothesis that stands, maybe `none`.
        tried: All hypotheses, best first, `none` among them.
        screening: The first one; a diagnosis asks once more what is invisible, on top of the chosen hypothesis.
        least: What an effect has to gain in cost here, to be more than chance.
        rejected: Single effects that cost less than the first that stands, and do not stand themselves.
    """

    none: Hypothesis
    chosen: Hypothesis
    tried: tuple[Hypothesis, ...]
    screening: Screening
    least: float = 0.0
    rejected: tuple[Hypothesis, ...] = ()

    @property
    def rivals(self) -> tuple[Hypothesis, ...]:
        """All that may stand in the chosen one's place, best first."""
        return tuple(fit for fit in self.tried if not any(fit is other for other in self.rejected))

    @property
    def gain(self) -> Gain:
        """Of the chosen hypothesis over calibration alone."""
        return gain(self.chosen, self.none)

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


def stands(hypothesis: Hypothesis, other: Hypothesis, least: float, flaw: float) -> bool:
    """Whether a hypothesis is significantly better, on the residuals beyond a flaw or by freeing the shifts.

    Over one with a value beyond its documented range it only has to be better, not significantly so: such a value does
    the work of something else.
    """
    better, freed = gain(hypothesis, other), other.fit.prior_cost - hypothesis.fit.prior_cost
    surely = better.low > 0.0 or (hypothesis.claims_its_names and not other.claims_its_names)
    on_residuals = better.value - freed
    beyond = freed + (max(0.0, on_residuals - flaw) if on_residuals > 0.0 else on_residuals)
    return surely and beyond > least


@dataclass
class Search:
    """A search for the effects behind a log: its problem, what counts, and all hypotheses that were tried so far.

    Attributes:
        problem: Where hypotheses compete.
        none: Calibration alone.
        thresholds: What counts as more than chance.
        most: Effects at once.
        width: Single effects that are continued; the settings' beam by default.
        tried: Hypotheses so far.
    """

    problem: Problem
    none: Hypothesis
    thresholds: Thresholds = field(default_factory=Thresholds)
    most: int = 3
    width: int | None = None
    tried: list[Hypothesis] = field(default_factory=list)

    def select(self) -> Selection:
        """Return the hypothesis that stands in the end, and all that were tried."""
        chosen, least = self.none, max(self.thresholds.gain, self.thresholds.share * self.none.cost)
        if self.nothing_left():
            return Selection(chosen, chosen, (chosen,), screen(self.problem, chosen), least)
        singles, screening = extend(self.problem, self.none, self._how.leads)
        if zeros_aside(self.problem, chosen):
            zeros = extend(self.problem.only(SHIFTS), chosen, self._how.leads)[0]
            seen = [single.places for single in singles]
            singles = sorted([*singles, *(zero for zero in zeros if zero.places not in seen)], key=by_cost)
        rejected, standing = self.part_singles(singles, least)
        self.tried = [self.none, *singles]
        if standing:
            chosen = self._grow(standing)
            chosen = self.split(self._polish(self.prune(chosen)))
            if self.thresholds.share:
                chosen = self._challenge(chosen)
            else:
                self._rival(chosen)
        return Selection(self.none, chosen, tuple(sorted(self.tried, key=by_cost)), screening, least, tuple(rejected))

    def nothing_left(self) -> bool:
        """Whether calibration alone leaves no more than noise, in every joint, and hides nothing."""
        none, how = self.none, self._how
        quiet = none.level <= how.noise_cost and float(none.levels.max()) <= how.room
        return quiet and not (self._lacking(none, how.room) or zeros_aside(self.problem, none))

    def part_singles(self, singles: list[Hypothesis], least: float) -> tuple[list[Hypothesis], list[Hypothesis]]:
        """Return the single effects before the first that stands, and those from it on, none if none stands.

        Each is asked in turn: a spurious effect that is a little cheaper, but not significantly, hides no other one.

        Args:
            singles: Best first.
            least: What one has to gain over calibration alone.
        """
        flaw = self._how.flaw * self.none.cost
        stand = (k for k, single in enumerate(singles) if self._stands(single, self.none, least, flaw))
        first = next(stand, len(singles))
        return (singles[:first], singles[first:]) if first < len(singles) else ([], [])

    def uphold(self, chosen: Hypothesis) -> set[str]:
        """Return the effects that stand because zeros of many joints are off to one side, whatever intervals say."""
        zeros = [k for k, candidate in enumerate(chosen.candidates) if candidate.effect in SHIFTS]
        fewer = {k: self.drop(chosen, k) if chosen.size > 1 else self.none for k in zeros}
        alone = [k for k, other in fewer.items() if moves_zeros_alone(self.problem, chosen, other)]
        return {chosen.candidates[k].effect for k in alone if explains_zeros(self.problem, chosen, fewer[k])}

    def look_again(self, selection: Selection) -> Selection:
        """Return a selection that knows what is invisible on top of the chosen hypothesis.

        Where joints shake or a robot walks another look costs too much: there it is what the plain simulator does not
        show.
        """
        if self.thresholds.share or not selection.chosen.candidates:
            return selection
        invisible = screen(self.problem, selection.chosen).invisible
        return replace(selection, screening=replace(selection.screening, invisible=invisible))

    @property
    def _how(self) -> SearchSettings:
        return self.problem.settings

    def _fit(self, chosen: Hypothesis, kept: list[int]) -> Hypothesis:
        """Fit some of the effects of a hypothesis anew from where they are."""
        start = np.concatenate([chosen.parameters[k] for k in kept])
        return self.problem.fit(tuple(chosen.candidates[k] for k in kept), start, chosen.fit.shifts)

    def _grow(self, singles: list[Hypothesis]) -> Hypothesis:
        """Add one effect after the other to the best single one as long as more is left than noise."""
        chosen = self._polish(singles[0]) if self.thresholds.share else singles[0]
        beam, level = self._distinct(singles), self._how.room
        while len({*chosen.names}) < self.most:
            better = self._add(self.problem, chosen, beam) if self._lacking(chosen, level) else []
            if not better and zeros_aside(self.problem, chosen):
                better = self._add(self.problem.only(SHIFTS), chosen, [chosen])
            if not better:
                break
            best = min(better, key=by_cost)
            chosen, beam, level = best, [best], self._how.room_after
        return chosen

    def _add(self, problem: Problem, chosen: Hypothesis, beam: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Return what stands against the chosen hypothesis of those with one effect more than one in the beam."""
        larger = [fit for base in beam for fit in extend(problem, base, self._how.leads_after)[0]]
        self.tried += larger
        return [fit for fit in larger if self._stands(fit, chosen, *self._bar(chosen))]

    def _stands(self, hypothesis: Hypothesis, other: Hypothesis, least: float, flaw: float) -> bool:
        """Whether a hypothesis stands against another one; zeros of many joints stand on grounds of their own."""
        if moves_zeros_alone(self.problem, hypothesis, other):
            return explains_zeros(self.problem, hypothesis, other)
        return stands(hypothesis, other, least, flaw)

    def _bar(self, standing: Hypothesis) -> tuple[float, float]:
        """Return what a further effect has to gain over what stands, and what a flaw of the model may gain."""
        left = max(0.0, standing.cost - float(standing.counts.sum()))
        least = max(self.thresholds.gain, self.thresholds.share * standing.cost, self._how.least_share * left)
        return least, self._how.minor * (self.none.cost - standing.cost)

    def _lacking(self, standing: Hypothesis, level: float) -> bool:
        """Whether more is left than noise, or hidden in shifts; the cost of joints that shake does not show it."""
        few = float(standing.levels.max()) > self._how.room_of_one  # which a mean over all joints does not show
        hides = self._most_to_free(standing) > self._how.hidden * self._bar(standing)[0]
        return standing.level > level or few or hides or bool(self.problem.train.comparison.shaking.any())

    def _most_to_free(self, standing: Hypothesis) -> float:
        """Return the prior cost that a cause would free most of: what the shifts of some joints have in common."""
        size = self.problem.simulator.spread * SPREADS[:, None]
        shifts = standing.fit.shifts / size
        freed = [(shifts[:, mask].mean(axis=1) ** 2).max() * mask.sum() for mask in self.problem.scopes.values()]
        return float(max(freed))

    def _distinct(self, singles: list[Hypothesis]) -> list[Hypothesis]:
        """Return the best hypotheses of different effects, not more than the beam is wide."""
        best: list[Hypothesis] = []
        for single in singles:
            if len(best) < (self.width or self._how.beam) and single.names not in [other.names for other in best]:
                best.append(single)
        return best

    def prune(self, chosen: Hypothesis) -> Hypothesis:
        """Drop effects that the others can do without, within their documented ranges if that is possible."""
        while chosen.size > 1:
            fewer = [self.drop(chosen, k) for k in range(chosen.size)]
            self.tried += fewer
            named = chosen.claims_its_names
            best = min(fewer, key=lambda fit: (named and not fit.claims_its_names, fit.cost))
            if self._stands(chosen, best, *self._bar(best)):
                break
            chosen = best
        return chosen

    def drop(self, chosen: Hypothesis, k: int) -> Hypothesis:
        """Return a hypothesis without its k-th effect, fitted anew."""
        return self._fit(chosen, [index for index in range(chosen.size) if index != k])

    def split(self, chosen: Hypothesis) -> Hypothesis:
        """Give causes of all joints to the groups apart, where the calibration makes up for what these differ by."""
        problem, scopes = self.problem, self.problem.scopes
        size, count = problem.simulator.spread * SPREADS, problem.train.joints
        groups = {name: mask for name, mask in scopes.items() if 1 < mask.sum() < count}
        if not groups or not np.all(np.sum(list(groups.values()), axis=0) == 1):
            return chosen
        for k, candidate in enumerate(chosen.candidates):
            rows = {share.row for share in shares([candidate], scopes) if share.joints.all()}
            means = [chosen.fit.shifts[row, mask].mean() / size[row] for row in rows for mask in groups.values()]
            if max(map(abs, means), default=0.0) < self._how.apart:
                continue
            apart = [candidate.on(name) for name in groups]
            values = [*chosen.parameters[:k], *[chosen.parameters[k]] * len(apart), *chosen.parameters[k + 1 :]]
            candidates = (*chosen.candidates[:k], *apart, *chosen.candidates[k + 1 :])
            parts = problem.fit(candidates, np.concatenate(values), chosen.fit.shifts, every=1)
            self.tried.append(parts)
            if self._stands(parts, chosen, *self._bar(chosen)):
                return self.prune(parts)
        return chosen

    def _rival(self, chosen: Hypothesis) -> None:
        """Try in the place of each effect, for which nothing of as many effects was tried, what did best without it."""
        for k in range(chosen.size):
            without = [fit for fit in sorted(self.tried, key=by_cost) if fit.lacks(chosen, k)]
            others = [
                (candidate, values)
                for fit in without
                for candidate, values in fit.pairs
                if (candidate.effect, candidate.scope) not in chosen.places
            ]
            if others and not any(fit.size == chosen.size for fit in without):
                candidate, values = others[0]
                rest = [index for index in range(chosen.size) if index != k]
                candidates = (*(chosen.candidates[index] for index in rest), candidate)
                start = np.concatenate([*(chosen.parameters[index] for index in rest), values])
                self.tried.append(self.problem.fit(candidates, start, chosen.fit.shifts))

    def _challenge(self, chosen: Hypothesis) -> Hypothesis:
        """Polish the nearest rivals too, and return the best: where joints shake, costs jump as much as they differ."""
        names, rivals = [set(chosen.names)], []
        for fit in sorted(self.tried, key=by_cost):
            near = fit.cost - chosen.cost < self._how.near * (self.none.cost - chosen.cost)
            if near and fit.size == chosen.size and set(fit.names) not in names:
                names.append(set(fit.names))
                rivals.append(fit)
        polished = [self._polish(rival) for rival in rivals[: self._how.challengers]]
        return min([chosen, *polished], key=by_cost)

    def _polish(self, chosen: Hypothesis) -> Hypothesis:
        """Fit what stands once more from where it is, with all derivatives taken anew at every step."""
        again = self.problem.fit(chosen.candidates, chosen.start, chosen.fit.shifts, every=1)
        self.tried.append(again)
        return again if again.fit.cost < chosen.fit.cost else chosen
