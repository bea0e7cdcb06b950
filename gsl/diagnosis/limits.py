"""Limits: how much of an effect that was not named a log leaves room for, on top of what was."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gsl.core.setting import settings_of
from gsl.diagnosis.attribute import Hypothesis, gain
from gsl.diagnosis.candidates import Candidate
from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.select import FLAW
from gsl.diagnosis.shared import ROWS
from gsl.diagnosis.shrinkage import FAR
from gsl.diagnosis.verdict import FOREIGN
from gsl.effects.effect import effect_class

TOLD, LEAST = 0.5, 0.002  # shares of a documented range: a limit above says nothing, one below is not searched
HALVINGS = 4  # to a factor of 1.4
ROUNDS = 3
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


def limits(found: Findings, shrunk: Mapping[str, Any], tick: Callable[[str], None]) -> list[Limit]:
    """Return what is below half of its documented range, the tightest first.

    Every effect that all joints may have none of is held at a value, all else fitted anew, until that is surely worse
    on held-out windows, by more than a simulator's own flaws may make of it. Left out is what a calibration does as
    well, whose prior would be the limit. Where much is left unexplained, be it in one regime (in turning round, say,
    where play would show), joints shake or a robot walks there is no answer to compare with; one motion is too little.

    Args:
        found: The diagnosis.
        shrunk: From `shrinkage`.
        tick: Called with what is going on.
    """
    exp, answer = found.experiment, found.answer
    verdict = found.verdict
    strange = verdict.word == "unknown" or (verdict.in_part and verdict.remaining > FOREIGN)
    if strange or not exp.by_record or exp.walking or exp.comparison.shaking.any():
        return []
    if any(one["after"] > FAR for one in (*shrunk["by_joint"], *shrunk["by_regime"])):
        return []
    left_out = {*answer.names, *found.selection.screening.invisible, *found.refuted}
    asked = [one for one in found.arena.library if one.effect not in left_out and _none_or_some(one)]
    if asked:
        tick("what the log leaves room for")
    told = [limit for one in asked if (limit := _limit(found, one))]
    return sorted(told, key=lambda one: one.most / one.documented)


def _none_or_some(one: Candidate) -> bool:
    alone = one.scope == "all" and len(one.fixed) == 1 and len(one.free) == 1
    return alone and one.documented[0, 0] == 0.0 and one.effect not in CALIBRATED


def _limit(found: Findings, one: Candidate) -> Limit | None:
    """Return the limit of an effect, None if half of what is documented costs too little.

    It is compared with hardly any of the effect and not with none: play of no width has teeth that give all the same.
    """
    (name,), documented = one.free, float(one.documented[1, 0])
    within = max(CERTAIN * found.widening**2, FLAW * found.selection.none.cost)  # as little is no reason to name it
    hardly = _with(found, one, LEAST * documented, found.answer)

    def surely_worse(share: float) -> bool:
        loss = gain(hardly, _with(found, one, share * documented, hardly))
        return loss.low > 0.0 and loss.value > within

    low, high = LEAST, TOLD
    if not surely_worse(high):
        return None
    for _ in range(HALVINGS):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if surely_worse(middle) else (middle, high)
    unit = settings_of(effect_class(one.effect))[name].unit
    most = max(high * documented, found.experiment.robot.encoder_step if unit == "rad" else 0.0)
    return Limit(one.effect, name, unit, most, documented) if most < TOLD * documented else None


def _with(found: Findings, one: Candidate, value: float, at: Hypothesis) -> Hypothesis:
    """Return the answer with an effect held at a value, all else fitted from another hypothesis."""
    nothing = np.empty((2, 0))
    held = replace(
        one, fixed=one.entry(np.array([value])), free=(), neutral=nothing[0], documented=nothing, bounds=nothing
    )
    start = np.concatenate([np.zeros(0), *at.parameters])
    return found.arena.fitted((*found.answer.candidates, held), start, at.fit.nuisances, every=1, rounds=ROUNDS)
