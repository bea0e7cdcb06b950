"""Caveats: what to be careful with in a diagnosis, one sentence each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gsl.diagnosis.attribute import NOISE_COST, Hypothesis, share
from gsl.diagnosis.candidates import Candidate
from gsl.diagnosis.deviations import far_off
from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.droop import Droop
from gsl.diagnosis.records import FEW
from gsl.diagnosis.select import passed_over

ASKED, STUCK = 0.05, 0.1  # command [rad], and share of it, below which a joint that moves less does not move
ROUGH = 20.0  # remaining cost of a residual, in that of noise, from which on a tolerance is advised
MUCH = 0.1  # share of the held-out excess that is left, from which on something else is at work


def caveats(
    found: Findings, unsure: Sequence[Droop], shrunk: Mapping[str, Any], far: Sequence[Mapping[str, Any]]
) -> list[str]:
    """Return what a reader should mind: what cannot be told apart, what remains, what the log could not give, ...

    Args:
        found: The diagnosis.
        unsure: Joints whose zero may be a droop.
        shrunk: From `shrinkage`.
        far: Parts of the log that are not explained, from `unexplained`.
    """
    parts = (_droops(unsure), _remaining(found, shrunk, far), _log(found), _joints(found), _causes(found))
    return [one for part in parts for one in part]


def _droops(unsure: Sequence[Droop]) -> Iterator[str]:
    if not unsure:
        return
    zeros = ", ".join(f"{one.joint} {1e3 * one.zero:+.0f} mrad" for one in unsure)
    yield (
        "Inseparable in this log, in which gravity hardly changes: a shifted zero and another droop under gravity, "
        f"by a load or a gain that is off. The fit calls it a zero: {zeros}."
    )
    if held := ", ".join(one.joint for one in unsure if not one.told):
        yield (
            f"No poses of one joint that a ladder may take change gravity enough there to tell: {held}. Turn the base "
            "round, or take poses by hand that a ladder leaves out because limbs might meet."
        )


def _log(found: Findings) -> Iterator[str]:
    exp = found.experiment
    if found.shift:
        yield f"The clocks are apart: {1e3 * found.shift:.1f} ms were taken out first, so that no latency can show."
    if found.baseline is not None and found.baseline.effects:
        names = ", ".join(found.baseline.effects)
        yield f"The reference shows it already, so it is no cause but a part of the simulator now: {names}."
    if exp.noise.source != "repeats":
        yield "No command was played twice: the noise floor is estimated from the roughness of the log."
    if exp.noise.unsteady.any():
        names = ", ".join(name for name, is_so in zip(exp.channels, exp.noise.unsteady, strict=True) if is_so)
        yield f"Repeats of the same commands differ here by far more than elsewhere, which counts as gap: {names}."
    if not exp.by_record:
        yield "There is one motion only: every second part of it was held out, which is weak evidence."
    elif len(np.unique(exp.pieces.record[exp.held_out])) < FEW:
        yield "Few trajectories are held out: intervals are over parts of them and may be too narrow."
    if not found.trials and found.verdict.causes and not exp.walking:
        yield "No self-test was made (duels=0): probabilities are those of the fit alone, and too sure."
    if found.tolerance:
        yield f"Differences of {1e3 * found.tolerance:.0f} mrad count as noise (tolerance): smaller causes cannot show."
    elif found.verdict.word == "unknown" and found.verdict.remaining > ROUGH:
        yield (
            "What is left is far above the noise, and everything counts as an outlier: say with tolerance=0.02 [rad] "
            "what does not matter, and the larger causes come out."
        )


def _joints(found: Findings) -> Iterator[str]:
    exp = found.experiment
    if exp.comparison.shaking.any():
        names = ", ".join(name for name, shakes in zip(exp.channels, exp.comparison.shaking, strict=True) if shakes)
        yield f"These joints shake while their commands rest and are judged by the spectrum: {names}."
    still = [name for k, name in enumerate(exp.joints) if max(np.ptp(r.targets[:, k]) for r in exp.records) < 1e-6]
    if still:
        yield f"These joints are never commanded to move, so hardly anything can be said of them: {', '.join(still)}."
    stuck = [name for k, name in enumerate(exp.joints) if _stuck(found, k)]
    if stuck:
        yield f"These joints are commanded to move and do not: {', '.join(stuck)}. Look at them first."
    if far := far_off(found):
        yield (
            "The calibration of these joints is far from what robots of one make differ by, so that it may hide a "
            f"cause: {', '.join(far)}."
        )


def _causes(found: Findings) -> Iterator[str]:
    yield from (f"{effect} would explain much, but {reason}." for effect, reason in found.refuted.items())
    if found.verdict.word not in ("causes", "inseparable"):
        return
    chosen = found.selection.chosen
    for candidate, values in zip(chosen.candidates, chosen.parameters, strict=True):
        for free, value, low, high in zip(candidate.free, values, *candidate.documented, strict=True):
            if not low <= value <= high:
                yield f"{_told(candidate, free)} of {value:.3g} is beyond what is documented, {low:g} to {high:g}."
    larger = next((one for one in found.selection.tried if _extends(one.places, chosen.places)), None)
    why = None if larger is None else passed_over(larger, chosen)
    if larger is not None and why is not None:
        yield _otherwise(chosen, larger, why)


def _otherwise(chosen: Hypothesis, larger: Hypothesis, why: str) -> str:
    """Return what values would be with further effects, which cost less and were passed over."""
    values = {(one.effect, one.scope): found for one, found in zip(larger.candidates, larger.parameters, strict=True)}
    further = ", ".join(one.effect.replace("_", " ") for one in larger.candidates if one.effect not in chosen.names)
    instead = [
        f"{_told(candidate, free)} {other:.3g} instead of {value:.3g}"
        for candidate, here in zip(chosen.candidates, chosen.parameters, strict=True)
        for free, value, other in zip(candidate.free, here, values[candidate.effect, candidate.scope], strict=True)
    ]
    return (
        f"With {further} besides, which costs less and was passed over ({why}): {', '.join(instead)}. Intervals are "
        "those of this answer alone."
    )


def _extends(places: frozenset[tuple[str, str]], chosen: frozenset[tuple[str, str]]) -> bool:
    return chosen < places and {effect for effect, _ in places - chosen}.isdisjoint(effect for effect, _ in chosen)


def _told(candidate: Candidate, free: str) -> str:
    return f"{candidate.effect.replace('_', ' ')}'s {free.replace('_', ' ')}"


def _remaining(found: Findings, shrunk: Mapping[str, Any], far: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    verdict, gone = found.verdict, shrunk["fraction"]
    if verdict.word in ("causes", "inseparable") and gone is not None and 1.0 - gone >= MUCH:
        yield f"{100.0 * (1.0 - gone):.0f} % of the held-out excess remains: something else is at work as well."
    elif verdict.in_part:
        selection = found.selection
        left = 100.0 * (1.0 - share(selection.chosen, selection.none, selection.none, NOISE_COST)[0])
        yield (
            f"Of what a calibration leaves {left:.0f} % remains, where outliers count for less: something "
            "else may be at work as well."
        )
    if far:
        parts = ", ".join(f"{one['part']} ({one['before']:.1f} → {one['after']:.1f} ×)" for one in far)
        yield (
            f"Not explained, still far from the robot, in noise floors: {parts}. What is not named is not excluded "
            "there."
        )


def _stuck(found: Findings, k: int) -> bool:
    """Whether a joint stays where it is for all that it is commanded."""
    records = found.experiment.records
    asked = max(float(np.ptp(one.targets[:, k])) for one in records)
    moved = max(float(np.ptp(one.position[:, k])) for one in records)
    return asked > ASKED and moved < STUCK * asked
