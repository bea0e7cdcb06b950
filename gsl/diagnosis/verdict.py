"""The verdict: what the evidence allows to say, and with which probability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gsl.diagnosis.attribute import NOISE_COST, Hypothesis, gain, share
from gsl.diagnosis.select import Selection, lacks
from gsl.effects.effect import TWINS

ALIKE = tuple(frozenset(pair) for pair in TWINS.items())  # in the air
SEPARATED = 0.75  # probability below which two causes are not told apart
BLUNT = 12.0  # least spread of a difference of costs, where no self-test has measured it
COARSE = 0.12  # share of a difference of costs that an imperfect model makes
WHOLE = 0.9  # share of the excess from which on causes are all there is
FOREIGN, EXPLAINED = 1.12, 0.85  # remaining cost, and share explained, beyond which nothing of the library is the cause
LOCAL = 1.5  # and remaining cost of one joint
KNOWN_SOFT = 0.15
UNRIVALLED = 0.9  # probability of an effect in whose place no other was tried: where replays are slow
LONE = 0.8  # factor on probabilities where parts of one motion were held out: they share what is particular to it


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
        known: Probability that nothing else is at work.
    """

    word: str
    causes: tuple[Cause, ...]
    inseparable: tuple[tuple[str, ...], ...]
    explained: float
    remaining: float
    known: float

    @property
    def in_part(self) -> bool:
        """Whether causes are named and leave so much that something else is at work as well."""
        return self.word in ("causes", "inseparable") and 0.0 < self.explained < WHOLE


def judged(
    found: Selection,
    expected: float,
    margins: Sequence[tuple[str, float]] = (),
    doubt: float = 0.0,
    *,
    walking: bool = False,
    lone: bool = False,
) -> Verdict:
    """Judge a selection.

    Args:
        found: What attribution came to.
        expected: Cost of a residual where only noise is left.
        margins: Spread of the difference of costs to a rival, by the rival's effect, as a self-test measured it.
        doubt: Share of a cost by which that of two causes differs by chance.
        walking: Whether the robot is on the ground, where the base tells what is alike in the air.
        lone: Whether there is one motion only.
    """
    chosen, none = found.chosen, found.none
    least = expected * float(none.counts.sum())
    excess = max(none.cost - least, 1e-9)
    explained = float(np.clip((none.cost - chosen.cost) / excess, 0.0, 1.0))
    remaining = chosen.level / expected
    strange = max(np.log(remaining) / np.log(FOREIGN), np.log(chosen.levels.max() / max(1.0, expected)) / np.log(LOCAL))
    if not chosen.candidates:
        return Verdict("unknown" if strange > 1.0 else "no_gap", (), (), 0.0, remaining, 1.0)
    spreads = dict(margins)
    causes = tuple(_cause(found, k, min(expected, NOISE_COST), spreads, doubt) for k in range(len(chosen.candidates)))
    known = _known(explained, float(strange))
    alike = () if walking else ALIKE
    groups: list[tuple[str, ...]] = [tuple(sorted(twins)) for twins in alike if twins & set(chosen.names)]
    for cause in causes:
        if cause.rival not in (None, chosen.names[cause.index]) and cause.probability < SEPARATED:
            groups.append((chosen.names[cause.index], str(cause.rival)))
    unique = tuple(dict.fromkeys(tuple(sorted(set(group))) for group in groups))
    sure = known * (LONE if lone else 1.0)
    scaled = tuple(replace(cause, probability=cause.probability * sure) for cause in causes)
    word = "unknown" if known < 0.5 else "inseparable" if unique else "causes"
    return Verdict(word, scaled, unique, explained, remaining, known)


def _known(explained: float, strange: float) -> float:
    """Return the probability that the library holds what is at work: much is left only where something is missing."""
    missing = strange - 1.0
    unexplained = (EXPLAINED - explained) / (1.0 - EXPLAINED)
    return float(1.0 / (1.0 + np.exp(min(missing, unexplained) / KNOWN_SOFT)))


def _cause(found: Selection, k: int, noise: float, spreads: dict[str, float], doubt: float) -> Cause:
    chosen = found.chosen
    rivals = [one for one in found.tried if len(one.candidates) <= len(chosen.candidates) and lacks(one, chosen, k)]
    fewer = min((one for one in rivals if len(one.candidates) < len(chosen.candidates)), key=_cost, default=found.none)
    value, low, high = (max(0.0, x) for x in share(chosen, fewer, found.none, noise))
    best = min((one for one in rivals if len(one.candidates) == len(chosen.candidates)), key=_cost, default=None)
    if best is None:
        return Cause(k, UNRIVALLED, None, value, low, high)
    other = next((name for name in best.names if name not in chosen.names), best.names[-1])
    return Cause(k, _ahead(best, chosen, max(spreads.get(other, 0.0), doubt * chosen.cost)), other, value, low, high)


def _ahead(rival: Hypothesis, chosen: Hypothesis, spread: float) -> float:
    """Return the probability that the chosen one is the truth and not its rival, from how much less it costs."""
    margin = rival.cost - chosen.cost
    over_records = gain(chosen, rival)
    noise = max(BLUNT, spread, COARSE * abs(found_cost(rival) - found_cost(chosen)))
    wide = max(noise, (over_records.high - over_records.low) / 4.0 * 0.5)
    return float(np.clip(1.0 / (1.0 + np.exp(-2.0 * margin / wide)), 0.01, 0.99))


def found_cost(one: Hypothesis) -> float:
    """Return the held-out cost without that of the nuisances."""
    return float(one.costs.sum())


def _cost(one: Hypothesis) -> float:
    return one.cost
