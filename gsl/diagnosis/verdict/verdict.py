"""The verdict: what the evidence allows to say, and with which probability."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from gsl.diagnosis.hypothesis.hypothesis import Hypothesis, by_cost, gain, name_in_place, share_of_excess
from gsl.diagnosis.search.selection import Selection
from gsl.diagnosis.settings import SearchSettings, VerdictSettings
from gsl.effects.effect import TWINS

ALIKE = tuple(frozenset(pair) for pair in TWINS.items())  # in the air
SHARPNESS = 2.0  # of log-odds, over a margin in its spread
EVEN = 0.5  # probability of each of two causes whose simulated logs get the same answer
FAR = 100.0  # beyond which a strangeness is no stranger


@dataclass(frozen=True)
class Cause:
    """One effect of the chosen hypothesis.

    Attributes:
        index: Its place there.
        probability: That it is this effect.
        rival: The effect that comes nearest in its place, if any.
        value, low, high: Share of the cost that a calibration leaves above the noise, which comes back without it, with
            95 % interval.
    """

    index: int
    probability: float
    rival: str | None
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Verdict:
    """What can be said.

    Attributes:
        word: `no_gap`, `causes`, `inseparable` or `unknown`.
        causes: Of the chosen hypothesis; empty for `no_gap`.
        inseparable: Groups of effects that the log cannot tell apart.
        explained: Share of the excess that the chosen hypothesis explains.
        remaining: Its cost of a residual over that of noise.
        complete: Probability that nothing else is at work.
        missing: What a law of each servo explains beyond it: see `Laws.missing`.
        whole: Share of the excess from which on causes are all there is.
        hollow: Whether calibration alone is so far within a guessed noise that nothing has to be explained.
        odd: Joints that shake otherwise than the chosen hypothesis makes them.
    """

    word: str
    causes: tuple[Cause, ...]
    inseparable: tuple[tuple[str, ...], ...]
    explained: float
    remaining: float
    complete: float
    whole: float = VerdictSettings.whole
    missing: float = 0.0
    hollow: bool = False
    odd: tuple[str, ...] = ()

    @property
    def names_causes(self) -> bool:
        """Whether it names causes, be some of them inseparable from others."""
        return self.word in ("causes", "inseparable")

    @property
    def in_part(self) -> bool:
        """Whether causes are named and leave so much that something else is at work as well."""
        return self.names_causes and 0.0 < self.explained < self.whole


@dataclass(frozen=True)
class Judge:
    """Judges selections on one log.

    Attributes:
        expected: Cost of a residual where only noise is left.
        worst: The same of the joint where most is left.
        margins: Spread of the difference of costs to a rival, by the rival's effect, as a self-test measured it.
        mistakes: Share of a self-test's logs of a rival, by the rival's effect, that the chosen one explains better.
        doubt: Share of a cost by which that of two causes differs by chance.
        walking: Whether the robot is on the ground, where the base shows what is alike in the air.
        lone: Whether there is one motion only.
        guessed: Whether the noise floor is a guess: nothing was repeated, and nobody said what does not matter.
        settings: What counts.
        noise_cost: Of a residual that is nothing but noise.
        odd: How oddly joints shake, by name: how much more than in logs of the hypothesis is left, 1 if too much.
    """

    expected: float
    worst: float = 1.0
    margins: Mapping[str, float] = field(default_factory=dict)
    mistakes: Mapping[str, float] = field(default_factory=dict)
    doubt: float = 0.0
    walking: bool = False
    lone: bool = False
    guessed: bool = False
    settings: VerdictSettings = field(default_factory=VerdictSettings)
    noise_cost: float = SearchSettings.noise_cost
    odd: Mapping[str, float] = field(default_factory=dict)

    def judge(self, selection: Selection, missing: float = 0.0) -> Verdict:
        """Return what a selection allows to say.

        Args:
            selection: What a search came to.
            missing: What a law of each servo explains beyond it: see `Laws.missing`.
        """
        how, chosen, none = self.settings, selection.chosen, selection.none
        least = self.expected * float(none.counts.sum())
        excess = max(none.cost - least, 1e-9)
        explained = float(np.clip((none.cost - chosen.cost) / excess, 0.0, 1.0))
        remaining = chosen.level / self.expected
        worst_joint = chosen.levels.max() / max(self.worst, self.expected)
        strange = max(np.log(remaining) / np.log(how.foreign), np.log(worst_joint) / np.log(how.local))
        quiet = (
            max(chosen.level / self.noise_cost, chosen.levels.max())
            if chosen.candidates
            else max(remaining, worst_joint)
        )
        if quiet <= how.beneath and not (chosen.candidates and self.guessed):
            missing = 0.0  # below the noise, or what a user says does not matter, a law has nothing to explain
        if not chosen.candidates:
            word = "unknown" if max(strange, missing) > 1.0 else "no_gap"
            return Verdict(word, (), (), 0.0, remaining, 1.0, how.whole, missing)
        causes = tuple(self._cause(selection, k) for k in range(chosen.size))
        complete = self._completeness(explained, float(strange), max([missing, *self.odd.values()]))
        groups = self._inseparable(chosen, causes)
        sure = complete * (how.lone if self.lone else 1.0)
        scaled = tuple(replace(cause, probability=cause.probability * sure) for cause in causes)
        freed = none.fit.prior_cost - chosen.fit.prior_cost  # what a calibration would have to be unusual for
        hollow = (
            self.guessed and none.level < how.beneath * self.expected and freed <= min(selection.least, selection.freed)
        )
        word = "unknown" if hollow or complete < 0.5 else "inseparable" if groups else "causes"
        odd = tuple(name for name, value in self.odd.items() if value > 1.0)
        return Verdict(word, scaled, groups, explained, remaining, complete, how.whole, missing, hollow, odd)

    def _inseparable(self, chosen: Hypothesis, causes: tuple[Cause, ...]) -> tuple[tuple[str, ...], ...]:
        alike = () if self.walking else ALIKE
        groups: list[tuple[str, ...]] = [tuple(sorted(twins)) for twins in alike if twins & set(chosen.names)]
        for cause in causes:
            name = chosen.names[cause.index]
            if cause.rival not in (None, name) and cause.probability < self.settings.separated:
                groups.append((name, str(cause.rival)))
        return tuple(dict.fromkeys(tuple(sorted(set(group))) for group in groups))

    def _completeness(self, explained: float, strange: float, missing: float) -> float:
        """Return the probability that the library holds what is at work.

        Where it does not, a law of each servo explains more than the effects do. Or a joint shakes as they do not make
        it. Or, where no servo has such a law, much is left of a gap that they hardly explain.
        """
        enough = self.settings.explained
        left = min(strange - 1.0, (enough - explained) / (1.0 - enough))
        return float(1.0 / (1.0 + np.exp(min(max(missing - 1.0, left), FAR) / self.settings.soft)))

    def _cause(self, selection: Selection, k: int) -> Cause:
        chosen, none = selection.chosen, selection.none
        rivals = [fit for fit in selection.rivals if fit.size <= chosen.size and fit.lacks(chosen, k)]
        fewer = min((fit for fit in rivals if fit.size < chosen.size), key=by_cost, default=none)
        noise = min(self.expected, self.noise_cost)
        value, low, high = (max(0.0, x) for x in share_of_excess(chosen, fewer, none, noise))
        best = min((fit for fit in rivals if fit.size == chosen.size), key=by_cost, default=None)
        if best is None:
            return Cause(k, self.settings.unrivalled, None, value, low, high)
        if best.cost >= none.cost:  # it explains nothing: the calibration itself is the rival
            return Cause(k, self._probability(none, chosen, self.doubt * chosen.cost), None, value, low, high)
        other = name_in_place(chosen, best)
        spread = max(self.margins.get(other, 0.0), self.doubt * chosen.cost)
        probability = self._probability(best, chosen, spread)
        probability -= self.mistakes.get(other, 0.0) * max(0.0, probability - EVEN)
        return Cause(k, probability, other, value, low, high)

    def _probability(self, rival: Hypothesis, chosen: Hypothesis, spread: float) -> float:
        """Return the probability that the chosen one is the truth and not its rival, from how much less it costs."""
        margin, over_records = rival.cost - chosen.cost, gain(chosen, rival)
        coarse = self.settings.coarse * abs(rival.residual_cost - chosen.residual_cost)
        noise = max(self.settings.blunt, spread, coarse)
        wide = max(noise, (over_records.high - over_records.low) / 4.0 * 0.5)
        return float(np.clip(1.0 / (1.0 + np.exp(-SHARPNESS * margin / wide)), 0.01, 0.99))
