"""What a log leaves open: causes that it cannot tell apart, and effects that it cannot show at all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gsl.diagnosis import nuisance
from gsl.diagnosis.attribute import Hypothesis
from gsl.diagnosis.candidates import Candidate
from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.rehearsal import Explanation, Rehearsal
from gsl.diagnosis.screen import merged
from gsl.diagnosis.verdict import ALIKE

NOTHING = "no effect"
STRENGTH = 0.5  # share of the way to the end of its range at which an effect should be seen
SHOWN = 30.0  # log-odds from which a log shows an effect of that strength: two a joint of a NAO
AT_THE_ENDS = "joint_limit"  # shows where joints come to their stops, and nowhere else
LIKE_DRY = "load_friction"  # and Coulomb friction of each joint's own are one under a single load
DRY = (0.0, 0.03, 0.1, 0.22, 0.45)  # Coulomb friction that is tried in its place [N·m]
LOOSE = 10.0  # how much freer the calibration is beside it


@dataclass(frozen=True)
class Question:
    """Two explanations of which the log prefers neither.

    Attributes:
        names: Of the effects in which they differ.
        truth: The likelier one.
        rivals: The other, as far as it could be fitted to the log; several are starts of its refit.
        loose: How far the rival's calibration may go, in its usual spread.
    """

    names: tuple[str, str]
    truth: Explanation
    rivals: tuple[Explanation, ...]
    loose: float = 1.0


def alike(found: Findings) -> list[tuple[str, ...]]:
    """Return the causes that nothing in the air can tell apart."""
    return [group for group in found.verdict.inseparable if set(group) in ALIKE]


def rivals(found: Findings) -> list[Question]:
    """Return the causes that the log cannot tell apart but another one might; of an unknown cause the nearest two."""
    chosen, tried, joints = found.selection.chosen, found.selection.tried, len(found.experiment.joints)
    if found.verdict.word == "unknown":
        near = [one for one in tried if one.candidates]
        other = next((one for one in near[1:] if set(one.names) != set(near[0].names)), None)
        return [] if other is None else [_question(near[0], other, joints)]
    pairs = [group for group in found.verdict.inseparable if set(group) not in ALIKE]
    return [_question(chosen, other, joints) for pair in pairs if (other := _rival(chosen, pair, tried)) is not None]


def _rival(chosen: Hypothesis, pair: Sequence[str], tried: Sequence[Hypothesis]) -> Hypothesis | None:
    """Return the best hypothesis in which the other effect of a pair stands in the place of the chosen one's."""
    own = [name for name in pair if name in chosen.names]
    others = set(pair) - set(own)
    fits = [one for one in tried if others & set(one.names) and not set(own) & set(one.names)]
    return min(fits, key=lambda one: (len(one.candidates) != len(chosen.candidates), one.cost), default=None)


def _question(first: Hypothesis, other: Hypothesis, joints: int) -> Question:
    apart = [[name for name in a.names if name not in b.names] for a, b in ((first, other), (other, first))]
    names = apart[0][0] if apart[0] else NOTHING, apart[1][0] if apart[1] else NOTHING
    return Question(names, _explanation(first, joints), (_explanation(other, joints),))


def _explanation(one: Hypothesis, joints: int) -> Explanation:
    """Return a hypothesis as a rehearsal takes it: of the joints alone, whose columns come first."""
    return Explanation(one.effects, one.fit.nuisances[:, :joints])


def hidden(found: Findings) -> list[Question]:
    """Return the effects that the log does not show at half their documented strength, each against its absence.

    A stop is no such question: to drive a robot to the ends of all its joints takes a suspicion.
    """
    chosen = _explanation(found.selection.chosen, len(found.experiment.joints))
    nothing, dry = (NOTHING, (chosen,), 1.0), ("coulomb_friction", _dry(chosen), LOOSE)
    seen = _seen_in(found)
    shown = {*found.selection.chosen.names, AT_THE_ENDS}
    questions: dict[str, Question] = {}
    for candidate in found.arena.library:
        if candidate.effect not in shown:
            truth = Explanation(merged(chosen.effects, candidate, _strong(candidate)), chosen.nuisances)
            name, absent, loose = dry if candidate.effect == LIKE_DRY else nothing
            question = Question((candidate.effect, name), truth, absent, loose)
            questions.setdefault(candidate.effect, question)
            shown |= {candidate.effect} if seen(question) else set()
    return [question for name, question in questions.items() if name not in shown]


def _seen_in(found: Findings) -> Callable[[Question], bool]:
    """Return how to ask whether the log shows an effect; of a walk it is known from the screening alone."""
    if found.experiment.walking:
        return lambda one: one.names[0] not in found.selection.screening.invisible
    log = Rehearsal.again(found)
    return lambda one: bool(log.log_odds(one.truth, one.rivals, loose=one.loose)[0] >= SHOWN)


def _dry(one: Explanation) -> tuple[Explanation, ...]:
    """Return an explanation with more and more Coulomb friction in every joint."""
    return tuple(Explanation(one.effects, one.nuisances + torque * _unit(one.nuisances)) for torque in DRY)


def _unit(nuisances: np.ndarray) -> np.ndarray:
    row = np.zeros_like(nuisances)
    row[nuisance.COULOMB] = 1.0
    return row


def _strong(candidate: Candidate) -> np.ndarray:
    """Return parameters half way from doing nothing to the farther end of their range."""
    lower, upper = candidate.documented
    end = np.where(candidate.neutral - lower > upper - candidate.neutral, lower, upper)
    return candidate.towards(end, STRENGTH)
