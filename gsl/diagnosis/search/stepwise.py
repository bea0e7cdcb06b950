"""Stepwise selection: from no effect to as many as the held-out windows bear out, and back by dropping one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gsl.diagnosis.hypothesis.common_mode import shares
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis, by_cost
from gsl.diagnosis.hypothesis.problem import Ask, Problem
from gsl.diagnosis.search.exempt import list_exemptions
from gsl.diagnosis.search.pairs import fit_pairs
from gsl.diagnosis.search.screening import extend, screen
from gsl.diagnosis.search.selection import Selection, Thresholds, stands
from gsl.diagnosis.search.zeros import SHIFTS, explains_zeros, moves_zeros_alone, zeros_aside
from gsl.diagnosis.settings import SearchSettings
from gsl.diagnosis.simulate.calibration import SPREADS


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
        chosen, least = self.none, self._least()
        if self.nothing_left():
            return Selection(chosen, chosen, (chosen,), screen(self.problem, chosen), least, self.thresholds.freed)
        singles, screening = extend(self.problem, self.none, self._how.leads)
        if (relaxed := self.problem.relax(self.none, singles)) is not self.none:
            self.none = chosen = relaxed
            least = self._least()
            singles, screening = extend(self.problem, relaxed, self._how.leads)
        if zeros_aside(self.problem, chosen):
            zeros = extend(self.problem.only(SHIFTS), chosen, self._how.leads)[0]
            seen = [single.places for single in singles]
            singles = sorted([*singles, *(zero for zero in zeros if zero.places not in seen)], key=by_cost)
        rejected, standing = self.part_singles(singles, least)
        self.tried = [self.none, *singles]
        if standing:
            standing[0] = self.exempt(standing[0])
            chosen = self._grow(standing, [standing[0], *singles] if self._shaking else standing)
            chosen = self.split(self.exempt(self._polish(self.prune(chosen))))
            if self.thresholds.share:
                chosen = self._challenge(chosen)
            else:
                self._rival(chosen)
        tried, freed = tuple(sorted(self.tried, key=by_cost)), self.thresholds.freed
        return Selection(self.none, chosen, tried, screening, least, freed, tuple(rejected))

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

    @property
    def _shaking(self) -> bool:
        return bool(self.problem.train.comparison.shaking.any())

    def _least(self) -> float:
        """Return what an effect has to gain over calibration alone."""
        return max(self.thresholds.gain, self.thresholds.share * self.none.cost)

    def _without(self, chosen: Hypothesis, dropped: int) -> Ask:
        """Return the fit of the other effects of a hypothesis from where they are."""
        kept = [k for k in range(chosen.size) if k != dropped]
        start = np.concatenate([chosen.parameters[k] for k in kept])
        return Ask(tuple(chosen.candidates[k] for k in kept), start, chosen.fit.shifts)

    def _grow(self, standing: list[Hypothesis], singles: list[Hypothesis]) -> Hypothesis:
        """Add one effect after the other to the best single one as long as more is left than noise.

        Args:
            standing: Single effects, from the first on that stands.
            singles: To which another one is added, be they significant alone or not.
        """
        chosen = self._polish(standing[0]) if self.thresholds.share else standing[0]
        beam, level = self._distinct(singles), self._how.room
        while len({*chosen.names}) < self.most:
            better = self._add(self.problem, chosen, beam) if self._lacking(chosen, level) else []
            if self._shaking and chosen.size == 1:
                better += self._pair(min(singles, key=by_cost), chosen)
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
        return self._keep_standing(larger, chosen)

    def _pair(self, single: Hypothesis, chosen: Hypothesis) -> list[Hypothesis]:
        """Return what stands against the chosen hypothesis of pairs of a single effect and another one."""
        return self._keep_standing(fit_pairs(self.problem, single.candidates[0], self._how.leads_after), chosen)

    def _keep_standing(self, larger: Sequence[Hypothesis], chosen: Hypothesis) -> list[Hypothesis]:
        """Return those of larger hypotheses that stand against the chosen one."""
        self.tried += larger
        return [fit for fit in larger if self._stands(fit, chosen, *self._bar(chosen))]

    def _stands(self, hypothesis: Hypothesis, other: Hypothesis, least: float, flaw: float) -> bool:
        """Whether a hypothesis stands against another one; zeros of many joints stand on grounds of their own."""
        if moves_zeros_alone(self.problem, hypothesis, other):
            return explains_zeros(self.problem, hypothesis, other)
        return stands(hypothesis, other, least, flaw, self._least_to_free(other))

    def _least_to_free(self, standing: Hypothesis) -> float:
        """Return what a further effect has to free of the cost of shifts, whatever chance gains on residuals."""
        left = max(0.0, standing.residual_cost - float(standing.counts.sum()))
        return max(self.thresholds.freed, self._how.least_share * left)

    def _bar(self, standing: Hypothesis) -> tuple[float, float]:
        """Return what a further effect has to gain over what stands, and what a flaw of the model may gain."""
        left = max(0.0, standing.cost - float(standing.counts.sum()))
        least = max(self.thresholds.gain, self.thresholds.share * standing.cost, self._how.least_share * left)
        return least, self._how.minor * (self.none.cost - standing.cost)

    def _lacking(self, standing: Hypothesis, level: float) -> bool:
        """Whether more is left than noise, or hidden in shifts; the cost of joints that shake does not show it."""
        few = float(standing.levels.max()) > self._how.room_of_one  # which a mean over all joints does not show
        hides = self._most_to_free(standing) > self._how.hidden * min(
            self._bar(standing)[0], self._least_to_free(standing)
        )
        return standing.level > level or few or hides or self._shaking

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
            fewer = self.problem.fit_all([self._without(chosen, k) for k in range(chosen.size)])
            self.tried += fewer
            named = chosen.claims_its_names
            best = min(fewer, key=lambda fit: (named and not fit.claims_its_names, fit.cost))
            if self._stands(chosen, best, *self._bar(best)):
                break
            chosen = best
        return chosen

    def drop(self, chosen: Hypothesis, k: int) -> Hypothesis:
        """Return a hypothesis without its k-th effect, fitted anew."""
        return self.problem.fit_all([self._without(chosen, k)])[0]

    def exempt(self, chosen: Hypothesis) -> Hypothesis:
        """Take joints out of causes of many joints, where the calibration undoes what these do."""
        least = max(self._how.gain, self.thresholds.share * chosen.cost)  # it is no effect more
        for place, joints, shifts in list_exemptions(self.problem, chosen):
            candidates = tuple(part.on(joints) if k == place else part for k, part in enumerate(chosen.candidates))
            fewer = self.problem.fit(candidates, chosen.start, shifts, every=1)
            self.tried.append(fewer)
            if stands(fewer, chosen, least, self._bar(chosen)[1]):
                return fewer
        return chosen

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
