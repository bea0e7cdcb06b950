"""What a log leaves open: causes that it cannot tell apart, and effects that it cannot show at all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gsl.diagnosis.design.rehearsal import Explanation, Rehearsal
from gsl.diagnosis.hypothesis.candidates import Candidate
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis
from gsl.diagnosis.search.screening import add_effect
from gsl.diagnosis.simulate.calibration import COULOMB
from gsl.diagnosis.verdict.findings import Findings
from gsl.diagnosis.verdict.verdict import ALIKE

NOTHING = "no effect"
AT_THE_ENDS = "joint_limit"  # shows where joints come to their stops, and nowhere else
LIKE_DRY = "load_friction"  # and Coulomb friction of each joint's own are one under a single load


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


def find_twins(findings: Findings) -> list[tuple[str, ...]]:
    """Return the causes that nothing in the air can tell apart."""
    return [group for group in findings.verdict.inseparable if set(group) in ALIKE]


def find_rivals(findings: Findings) -> list[Question]:
    """Return the causes that the log cannot tell apart but another one might; of an unknown cause the nearest two."""
    selection, joints = findings.selection, len(findings.log.joints)
    if findings.verdict.word == "unknown":
        near = [fit for fit in selection.tried if fit.candidates]
        other = next((fit for fit in near[1:] if set(fit.names) != set(near[0].names)), None)
        return [] if other is None else [_question(near[0], other, joints)]
    pairs = [group for group in findings.verdict.inseparable if set(group) not in ALIKE]
    others = [_rival(selection.chosen, pair, selection.tried) for pair in pairs]
    return [_question(selection.chosen, other, joints) for other in others if other is not None]


def _rival(chosen: Hypothesis, pair: Sequence[str], tried: Sequence[Hypothesis]) -> Hypothesis | None:
    """Return the best hypothesis in which the other effect of a pair stands in the place of the chosen one's."""
    own = [name for name in pair if name in chosen.names]
    others = set(pair) - set(own)
    fits = [fit for fit in tried if others & set(fit.names) and not set(own) & set(fit.names)]
    return min(fits, key=lambda fit: (fit.size != chosen.size, fit.cost), default=None)


def _question(first: Hypothesis, other: Hypothesis, joints: int) -> Question:
    apart = [[name for name in a.names if name not in b.names] for a, b in ((first, other), (other, first))]
    names = apart[0][0] if apart[0] else NOTHING, apart[1][0] if apart[1] else NOTHING
    return Question(names, _explanation(first, joints), (_explanation(other, joints),))


def _explanation(hypothesis: Hypothesis, joints: int) -> Explanation:
    """Return a hypothesis as a rehearsal takes it: of the joints alone, whose columns come first."""
    return Explanation(hypothesis.effects, hypothesis.fit.shifts[:, :joints])


def find_hidden(findings: Findings) -> list[Question]:
    """Return the effects that the log does not show at half their documented strength, each against its absence.

    A stop is no such question: to drive a robot to the ends of all its joints takes a suspicion.
    """
    how, selection = findings.options.design, findings.selection
    chosen = _explanation(selection.chosen, len(findings.log.joints))
    nothing = (NOTHING, (chosen,), 1.0)
    dry = ("coulomb_friction", tuple(_add_friction(chosen, torque) for torque in how.dry), how.loose)
    shows = _visibility(findings)
    visible = {*selection.chosen.names, AT_THE_ENDS}
    questions: dict[str, Question] = {}
    for candidate in findings.problem.library:
        if candidate.effect not in visible:
            effects = add_effect(chosen.effects, candidate, _strong(candidate, how.strength))
            name, absent, loose = dry if candidate.effect == LIKE_DRY else nothing
            question = Question((candidate.effect, name), Explanation(effects, chosen.shifts), absent, loose)
            questions.setdefault(candidate.effect, question)
            visible |= {candidate.effect} if shows(question) else set()
    return [question for name, question in questions.items() if name not in visible]


def _visibility(findings: Findings) -> Callable[[Question], bool]:
    """Return how to ask whether the log shows an effect; of a walk it is known from the screening alone."""
    if findings.log.walking:
        return lambda question: question.names[0] not in findings.selection.screening.invisible
    log, least = Rehearsal.again(findings), findings.options.design.visible
    return lambda question: bool(log.log_odds(question.truth, question.rivals, loose=question.loose)[0] >= least)


def _add_friction(explanation: Explanation, torque: float) -> Explanation:
    """Return an explanation with more Coulomb friction in every joint."""
    row = np.zeros_like(explanation.shifts)
    row[COULOMB] = 1.0
    return Explanation(explanation.effects, explanation.shifts + torque * row)


def _strong(candidate: Candidate, strength: float) -> np.ndarray:
    """Return parameters a part of the way from doing nothing to the farther end of their range."""
    lower, upper = candidate.documented
    end = np.where(candidate.neutral - lower > upper - candidate.neutral, lower, upper)
    return candidate.towards(end, strength)
