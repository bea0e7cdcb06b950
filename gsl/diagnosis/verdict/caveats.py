"""Caveats: what to be careful with in a diagnosis, one sentence each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gsl.core.body import Robot
from gsl.core.words import several
from gsl.diagnosis.angles import say, write_angle
from gsl.diagnosis.hypothesis.candidates import Candidate
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis, share_of_excess
from gsl.diagnosis.log.records import FEW
from gsl.diagnosis.simulate.calibration import (
    COULOMB,
    INERTIA,
    INERTIAS,
    KD,
    KP,
    NAMES,
    OFFSET,
    SPREADS,
    ZERO,
    inertia_unit,
)
from gsl.diagnosis.verdict.findings import Findings
from gsl.diagnosis.verdict.zero_or_load import Droop

LISTED = 3  # joints with their calibration in a sentence, which has to be read
TOLERANCE = 0.02  # proposed where no law says what is left [rad]
AMPLE = 1.5  # times what is left, that is proposed: within it nothing has to be explained
NEARLY = 0.95  # share of the gap that goes with the nearest effects, from which on it is asked whether the rest matters


def caveats(
    findings: Findings, unsure: Sequence[Droop], shrunk: Mapping[str, Any], far: Sequence[Mapping[str, Any]]
) -> list[str]:
    """Return what a reader should mind: what cannot be told apart, what remains, what the log could not give, ...

    Args:
        findings: The diagnosis.
        unsure: Joints whose zero may be a droop.
        shrunk: From `shrinkage`.
        far: Parts of the log that are not explained, from `find_unexplained`.
    """
    about_fit = (_droops(findings, unsure), _remaining(findings, shrunk, far))
    parts = (*about_fit, _log(findings, shrunk), _joints(findings), _causes(findings))
    return [sentence for part in parts for sentence in part]


def _droops(findings: Findings, unsure: Sequence[Droop]) -> Iterator[str]:
    if not unsure:
        return
    zeros = ", ".join(f"{droop.joint} {write_angle(findings.log.robot, droop.joint, droop.zero)}" for droop in unsure)
    yield (
        "Inseparable in this log, in which gravity hardly changes: a shifted zero and another droop under gravity, "
        f"by a load or a gain that is off. The fit calls it a zero: {zeros}."
    )
    if held := ", ".join(droop.joint for droop in unsure if not droop.separable):
        yield (
            f"No poses of one joint that a ladder may take change gravity enough there to tell: {held}. Turn the base "
            "round, or take poses by hand that a ladder leaves out because limbs might meet."
        )


def _log(findings: Findings, shrunk: Mapping[str, Any]) -> Iterator[str]:
    log, tolerance = findings.log, findings.options.tolerance
    if findings.shift:
        yield f"The clocks are apart: {1e3 * findings.shift:.1f} ms were taken out first, so that no latency can show."
    if findings.baseline is not None and findings.baseline.effects:
        names = ", ".join(findings.baseline.effects)
        yield f"The reference shows it already, so it is no cause but a part of the simulator now: {names}."
    if log.noise.source != "repeats":
        yield "No command was played twice: the noise floor is estimated from the roughness of the log."
    if log.noise.unsteady.any():
        names = _names(log.channels, log.noise.unsteady)
        yield f"Repeats of the same commands differ here by far more than elsewhere, which counts as gap: {names}."
    if not log.by_record and log.motions > 1:
        yield (
            "Motions without names: blocks of 1.2 s of each were held out, and none as a whole. Labels, or held_out=, "
            "say which motions are variants of one."
        )
    elif not log.by_record:
        yield "There is one motion only: every second part of it was held out, which is weak evidence."
    elif len(np.unique(log.pieces.record[log.held_out])) < FEW:
        yield "Few trajectories are held out: intervals are over parts of them and may be too narrow."
    if not findings.trials and findings.verdict.causes and not log.walking:
        yield "No self-test was made (duels=0): probabilities are those of the fit alone, and too sure."
    if tolerance:
        yield f"Differences of {1e3 * tolerance:.0f} mrad count as noise (tolerance): smaller causes cannot show."
    elif findings.verdict.word == "unknown" and findings.verdict.remaining > findings.options.verdict.rough:
        yield _ask_for_a_floor(findings)
    elif findings.verdict.hollow:
        named = ", ".join(dict.fromkeys(findings.selection.chosen.names)).replace("_", " ")
        yield (
            f"The log is so rough that even the plain simulator is within its noise. {named.capitalize()} fits better, "
            "but nothing says that it has to: record a motion twice, which measures the noise."
        )
    elif (
        findings.verdict.word == "unknown"
        and not findings.verdict.odd
        and shrunk["nearest_left"]
        and (shrunk["nearest_fraction"] or 0.0) >= NEARLY
    ):
        yield _ask_what_matters(findings, shrunk)


def _ask_for_a_floor(findings: Findings) -> str:
    """Say how to get a better floor, and propose what even a law of each servo leaves as what does not matter."""
    log, laws, calm = findings.log, findings.laws, ~findings.log.comparison.shaking
    left = TOLERANCE if laws is None else float(np.sqrt(np.mean((laws.z * log.comparison.floor)[..., calm] ** 2)))
    twice = "" if log.noise.source == "repeats" else "record a motion twice, which measures the noise, or "
    return (
        f"What is left is far above the noise, so everything counts as an outlier: {twice}say with "
        f"tolerance={left:.1g} [rad] what does not matter."
    )


def _ask_what_matters(findings: Findings, shrunk: Mapping[str, Any]) -> str:
    """Propose a little more than the nearest effects leave as what does not matter, rounded up to one digit."""
    nearest = "the nearest effects and a calibration" if findings.selection.chosen.candidates else "a calibration"
    left, gone = shrunk["nearest_left"], 100.0 * shrunk["nearest_fraction"]
    digit = 10.0 ** math.floor(math.log10(AMPLE * left))
    return (
        f"With {nearest} {min(gone, 99.9):.3g} % of the gap is gone. What is left, "
        f"{1e3 * left:.2g} mrad, is beyond the noise. If it does not matter, diagnose again with "
        f"tolerance={math.ceil(AMPLE * left / digit) * digit:.1g} [rad]."
    )


def _joints(findings: Findings) -> Iterator[str]:
    log, how = findings.log, findings.options.verdict
    if log.comparison.shaking.any():
        names = _names(log.channels, log.comparison.shaking)
        yield f"These joints shake though their commands do not, and are judged by the spectrum: {names}."
    if findings.verdict.odd:
        names = ", ".join(findings.verdict.odd)
        yield f"The nearest effects make these joints shake otherwise, so something else is at work: {names}."
    sent = np.array([np.ptp(record.commands, axis=0) for record in log.records]).max(axis=0)
    sent = sent.reshape(-1, log.records[0].targets.shape[1])[:, : len(log.joints)]
    asked = sent[0]
    moved = np.array([np.ptp(record.position, axis=0) for record in log.records]).max(axis=0)
    if (still := (sent < log.settings.floor.still).all(axis=0)).any():
        names = _names(log.joints, still)
        yield f"These joints are never commanded to move, so hardly anything can be said of them: {names}."
    if (stuck := (asked > how.asked) & (moved < how.stuck * asked)).any():
        names = _names(log.joints, stuck)
        yield f"These joints are commanded to move and do not: {names}. Look at them first."
    if far := out_of_family(findings):
        yield (
            "The calibration of these joints is far from what robots of one make differ by, so that it may hide a "
            f"cause: {list_first(far)}."
        )


def _names(names: Sequence[str], mask: np.ndarray) -> str:
    return ", ".join(name for name, is_so in zip(names, mask, strict=True) if is_so)


def list_first(joints: Sequence[str]) -> str:
    """Return joints with commas between; of many the first ones, for the calibration has them all."""
    more = len(joints) - LISTED
    rest = f", and {several(more, 'joint')} more: see the calibration" if more > 0 else ""
    return ", ".join(joints[:LISTED]) + rest


def out_of_family(findings: Findings) -> list[str]:
    """Return the joints whose calibration is further off than robots of one make differ by, the farthest first."""
    log, shifts = findings.log, findings.shifts
    off = np.abs(shifts / (findings.simulator.spread * SPREADS[:, None]))
    inertias = inertia_unit(findings.uncalibrated.servo)
    joints = []
    for k in np.argsort(-off.max(axis=0), kind="stable"):
        rows = [row for row in np.argsort(-off[:, k]) if off[row, k] >= findings.options.verdict.off]
        parts = [_shift(log.robot, log.joints[k], row, shifts[row, k], inertias[k]) for row in rows]
        joints += [f"{log.joints[k]} ({', '.join(parts)})"] if parts else []
    return joints


def _shift(robot: Robot, joint: str, row: int, value: float, inertia: float) -> str:
    if row in (KP, KD):
        return f"{NAMES[row]} × {np.exp(value):.2f}"
    if row in (ZERO, OFFSET):
        return f"{NAMES[row]} {write_angle(robot, joint, value)}"
    if row == INERTIA:
        end = ", at its limit" if value in INERTIAS else ""
        factor, unit = say(robot, (joint,), "kg·m²")
        return f"inertia {1e3 * factor * inertia * value:+.2g} {unit.removeprefix('k')}{end}"
    factor, unit = say(robot, (joint,), "N·m" if row == COULOMB else "N·m·s/rad")
    return f"{NAMES[row]} {factor * robot.torque_unit * value:+.2g} {unit}"


def _causes(findings: Findings) -> Iterator[str]:
    yield from (f"{effect} would explain much, but {reason}." for effect, reason in findings.refuted.items())
    if not findings.verdict.names_causes:
        return
    selection, chosen = findings.selection, findings.selection.chosen
    for candidate, values in chosen.pairs:
        shown = candidate.tell(findings.log.robot, np.vstack([values, candidate.documented]))
        for free, value, low, high in zip(candidate.free, *shown, strict=True):
            if not low <= value <= high:
                yield f"{_words(candidate, free)} of {value:.3g} is beyond what is documented, {low:g} to {high:g}."
    larger = next((fit for fit in selection.tried if _extends(fit.places, chosen.places)), None)
    why = None if larger is None else selection.objection(larger)
    if larger is not None and why is not None:
        yield from _otherwise(findings.log.robot, chosen, larger, why)


def _otherwise(robot: Robot, chosen: Hypothesis, larger: Hypothesis, why: str) -> Iterator[str]:
    """Yield what values would be with further effects, which cost less and were passed over, if they differ as told."""
    parameters = {(candidate.effect, candidate.scope): values for candidate, values in larger.pairs}
    further = ", ".join(effect.replace("_", " ") for effect in larger.names if effect not in chosen.names)
    instead = [
        f"{_words(candidate, free)} {other:.3g} instead of {value:.3g}"
        for candidate, here in chosen.pairs
        for free, value, other in zip(
            candidate.free,
            *candidate.tell(robot, np.vstack([here, parameters[candidate.effect, candidate.scope]])),
            strict=True,
        )
        if f"{other:.3g}" != f"{value:.3g}"
    ]
    if instead:
        yield (
            f"With {further} besides, which costs less and was passed over ({why}): {', '.join(instead)}. "
            "Intervals are those of this answer alone."
        )


def _extends(places: frozenset[tuple[str, str]], chosen: frozenset[tuple[str, str]]) -> bool:
    return chosen < places and {effect for effect, _ in places - chosen}.isdisjoint(effect for effect, _ in chosen)


def _words(candidate: Candidate, free: str) -> str:
    return f"{candidate.effect.replace('_', ' ')}'s {free.replace('_', ' ')}"


def _remaining(findings: Findings, shrunk: Mapping[str, Any], far: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    verdict, gone = findings.verdict, shrunk["fraction"]
    if verdict.names_causes and gone is not None and 1.0 - gone >= findings.options.verdict.left:
        yield f"{100.0 * (1.0 - gone):.0f} % of the held-out excess remains: something else is at work as well."
    elif verdict.in_part:
        none, chosen = findings.selection.none, findings.selection.chosen
        left = 100.0 * (1.0 - share_of_excess(chosen, none, none, findings.options.search.noise_cost)[0])
        yield (
            f"Of what a calibration leaves {left:.0f} % remains, where outliers count for less: something "
            "else may be at work as well."
        )
    if far:
        parts = ", ".join(f"{row['part']} ({row['before']:.1f} → {row['after']:.1f} ×)" for row in far)
        yield (
            f"Not explained, still far from the robot, in noise floors: {parts}. What is not named is not excluded "
            "there."
        )
