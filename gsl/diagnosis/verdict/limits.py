"""Limits: how much of an effect that was not named a log leaves room for, on top of what was."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gsl.core.setting import settings_of
from gsl.diagnosis.hypothesis.candidates import Candidate
from gsl.diagnosis.hypothesis.common_mode import ROWS
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis, gain
from gsl.diagnosis.verdict.findings import Findings
from gsl.effects.effect import effect_class

CALIBRATED = {effect for effect, _ in ROWS} | {"armature"}  # whose row is of inertia units and shared with nothing
CERTAIN = 1.96**2  # rise of a cost that an interval of 95 % holds, were windows independent


@dataclass(frozen=True)
class Limit:
    """How much of an effect, on all joints, there may be.

    Attributes:
        effect: Its name.
        parameter: Its only one.
        unit: Of the parameter.
        most: From where on the log speaks against it, if the answer is right; no angle below a step of the encoders.
        documented: Upper end of its documented range, of this robot if it has its own.
    """

    effect: str
    parameter: str
    unit: str
    most: float
    documented: float


def limits(findings: Findings, shrunk: Mapping[str, Any], tick: Callable[[str], None]) -> list[Limit]:
    """Return what is below half of its documented range, the tightest first.

    Every effect that all joints may have none of is held at a value, all else fitted anew, until that is significantly
    worse on held-out windows, by more than a simulator's own flaws may make of it. Left out is what a calibration does
    as well, whose prior would be the limit. Where much is left unexplained, be it in one regime (in turning round, say,
    where play would show), joints shake or a robot walks there is no answer to compare with; one motion is too little.

    Args:
        findings: The diagnosis.
        shrunk: From `shrinkage`.
        tick: Called with what is going on.
    """
    log, answer, verdict, how = findings.log, findings.answer, findings.verdict, findings.options.verdict
    strange = verdict.word == "unknown" or (verdict.in_part and verdict.remaining > how.foreign)
    if strange or (not log.by_record and log.motions == 1) or log.walking or log.comparison.shaking.any():
        return []
    if any(row["after"] > how.far for row in (*shrunk["by_joint"], *shrunk["by_regime"])):
        return []
    left_out = {*answer.names, *findings.selection.screening.invisible, *findings.refuted}
    asked = [part for part in findings.problem.library if part.effect not in left_out and _none_or_some(part)]
    if asked:
        tick("what the log leaves room for")
    result = [limit for part in asked if (limit := _limit(findings, part))]
    return sorted(result, key=lambda limit: limit.most / limit.documented)


def _none_or_some(candidate: Candidate) -> bool:
    alone = candidate.scope == "all" and len(candidate.fixed) == 1 and len(candidate.free) == 1
    return alone and candidate.documented[0, 0] == 0.0 and candidate.effect not in CALIBRATED


def _limit(findings: Findings, candidate: Candidate) -> Limit | None:
    """Return the limit of an effect, None if half of what is documented costs too little.

    It is compared with hardly any of the effect and not with none: play of no width has teeth that give all the same.
    """
    (name,), documented, how = candidate.free, float(candidate.documented[1, 0]), findings.options.verdict
    flaw = findings.problem.settings.flaw * findings.selection.none.cost
    within = max(CERTAIN * findings.widening**2, flaw)  # as little is no reason to name it
    hardly = _fit_beside(findings, candidate, how.hardly * documented, findings.answer)

    def surely_worse(share: float) -> bool:
        loss = gain(hardly, _fit_beside(findings, candidate, share * documented, hardly))
        return loss.low > 0.0 and loss.value > within

    low, high = how.hardly, how.limit
    if not surely_worse(high):
        return None
    for _ in range(how.halvings):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if surely_worse(middle) else (middle, high)
    angle = settings_of(effect_class(candidate.effect))[name].unit == "rad"
    most = max(high * documented, findings.log.robot.encoder_step if angle else 0.0)
    ((factor, unit),) = candidate.say(findings.log.robot)
    limit = Limit(candidate.effect, name, unit, factor * most, factor * documented)
    return limit if most < how.limit * documented else None


def _fit_beside(findings: Findings, candidate: Candidate, value: float, at: Hypothesis) -> Hypothesis:
    """Return the answer with an effect held at a value, all else fitted from another hypothesis."""
    nothing, entry = np.empty((2, 0)), candidate.entry(np.array([value]))
    none = {"free": (), "neutral": nothing[0], "strong": np.zeros(0, dtype=bool)}
    held = replace(candidate, fixed=entry, documented=nothing, bounds=nothing, **none)
    rounds = findings.options.verdict.limit_rounds
    return findings.problem.fit((*findings.answer.candidates, held), at.start, at.fit.shifts, every=1, rounds=rounds)
