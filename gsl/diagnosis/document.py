"""The diagnosis as a document: what report.json holds, and what the page and the terminal show of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from gsl.core.body import Robot
from gsl.core.setting import settings_of
from gsl.diagnosis import nuisance
from gsl.diagnosis.attribute import NOISE_COST, Hypothesis, share
from gsl.diagnosis.candidates import Candidate
from gsl.diagnosis.deviations import far_off
from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.droop import Droop, droops
from gsl.diagnosis.localise import cells, horizon, regimes, sides
from gsl.diagnosis.records import FEW
from gsl.diagnosis.select import passed_over
from gsl.diagnosis.shrinkage import shrinkage, unexplained
from gsl.diagnosis.summary import doubt, summary
from gsl.diagnosis.verdict import Cause
from gsl.effects.effect import effect_class

RANKED = 12  # hypotheses that are listed
ASKED, STUCK = 0.05, 0.1  # command [rad], and share of it, below which a joint that moves less does not move
ROUGH = 20.0  # remaining cost of a residual, in that of noise, from which on a tolerance is advised
REPLAYS, SHOWN = 6, 400  # pictures of replays, and their ticks at most


def document(found: Findings, **about: Any) -> dict[str, Any]:
    """Return the whole document; `about` is what the caller knows besides: data, world_file, report, command, ..."""
    exp, answer, sim = found.experiment, found.answer, found.simulator
    everything = exp.bench(sim, "all")
    told = sim.told({}, nuisance.none(len(exp.channels)), exp.pieces)
    z = exp.comparison.residual(told, exp.pieces)
    times, growth = horizon(exp, told)
    unsure = droops(found)
    causes = [] if found.verdict.word in ("no_gap", "unknown") else [_cause(found, one) for one in found.verdict.causes]
    after = everything.simulator.told(answer.effects, answer.fit.nuisances, exp.pieces)
    shrunk = shrinkage(found, told, after)
    places = [asdict(cell) for cell in cells(exp, z, regimes(exp, found.corrected))]
    return {
        "verdict": found.verdict.word,
        "summary": summary(found.verdict, causes, shrunk),
        "causes": causes,
        "sure": not doubt(causes),
        "suspects": [_cause(found, one) for one in found.verdict.causes] if found.verdict.word == "unknown" else [],
        "inseparable": [list(group) for group in found.verdict.inseparable if causes],
        "droops": [asdict(one) for one in unsure],
        "where": [place for place in places if place["named"] or place["regime"] == "all"],
        "horizon": {"time": times, "rms": growth},
        "sides": sides(exp, z),
        "shrinkage": shrunk,
        "ranking": _ranking(found),
        "least_gain": found.selection.least,
        "calibration": _calibration(found),
        "floor": {
            "source": exp.noise.source,
            "pairs": exp.noise.pairs,
            "sd": dict(zip(exp.channels, exp.comparison.floor.tolist(), strict=True)),
        },
        "invisible": list(found.selection.screening.invisible),
        "caveats": [*_caveats(found, unsure), *_unexplained(shrunk, causes)],
        "limits": [],
        "next_experiment": None,
        "policy_gap": None,
        "replays": _replays(found, told, after),
        "self_test": _self_test(found),
        **about,
    }


def _cause(found: Findings, one: Cause) -> dict[str, Any]:
    chosen = found.selection.chosen
    candidate, values = chosen.candidates[one.index], chosen.parameters[one.index]
    first = sum(len(other.free) for other in chosen.candidates[: one.index])
    sd = np.sqrt(np.maximum(0.0, np.diag(chosen.fit.covariance)))[first : first + len(values)]
    return {
        "effect": candidate.effect,
        "joints": _joints(found.experiment.robot, candidate),
        "scope": candidate.scope,
        "fixed": {key: value for key, value in candidate.fixed.items() if key != "joints"},
        "parameters": _parameters(candidate, values, sd * found.widening),
        "probability": one.probability,
        "gain": {"value": one.value, "low": one.low, "high": one.high},
        "meaning": (effect_class(candidate.effect).__doc__ or "").strip().splitlines()[0],
    }


def _joints(robot: Robot, candidate: Candidate) -> list[str]:
    if not candidate.on_joints:
        return []
    named = candidate.scope
    members = robot.controlled if named == "all" else robot.groups.get(named, (named,))
    return [name for name in members if name in robot.controlled]


def _parameters(candidate: Candidate, values: np.ndarray, sd: np.ndarray) -> dict[str, Any]:
    known = settings_of(effect_class(candidate.effect))
    return {
        name: {
            "value": float(value),
            "low": float(max(low, value - 1.96 * spread)),
            "high": float(min(high, value + 1.96 * spread)),
            "unit": known[name].unit,
        }
        for name, value, spread, low, high in zip(candidate.free, values, sd, *candidate.bounds, strict=True)
    }


def _ranking(found: Findings) -> list[dict[str, Any]]:
    none, rows = found.selection.none, []
    best: dict[frozenset[tuple[str, str]], Hypothesis] = {}
    for one in found.selection.tried:
        best.setdefault(one.places, one)
    for one in [*best.values()][:RANKED]:
        value, low, high = share(one, none, none, NOISE_COST)
        rows.append(
            {
                "effects": list(one.names),
                "scopes": [candidate.scope for candidate in one.candidates],
                "parameters": _written(one),
                "gain": {"value": value, "low": low, "high": high},
                "level": one.level,
                "behind": one.cost - found.selection.chosen.cost,
                "passed_over": passed_over(one, found.selection.chosen),
            }
        )
    return rows


def _written(one: Hypothesis) -> str:
    pairs = zip(one.candidates, one.parameters, strict=True)
    return "; ".join(
        ", ".join(f"{name} {value:.3g}" for name, value in zip(candidate.free, values, strict=True))
        for candidate, values in pairs
    )


def _calibration(found: Findings) -> list[dict[str, Any]]:
    joints, unit = found.experiment.joints, found.experiment.robot.torque_unit
    rotors = nuisance.inertia_unit(found.simulator.plant.servo)
    columns = zip(joints, found.answer.fit.nuisances.T, rotors, strict=False)  # coupled motors and a base follow
    return [
        {
            "joint": joint,
            "kp": float(np.exp(kp)),
            "kd": float(np.exp(kd)),
            "coulomb": unit * float(coulomb),
            "viscous": unit * float(viscous),
            "zero": float(zero + offset),
            "inertia": float(inertia * rotor),
        }
        for joint, (kp, kd, coulomb, zero, offset, inertia, viscous), rotor in columns
    ]


def _caveats(found: Findings, unsure: Sequence[Droop]) -> list[str]:
    exp, said = found.experiment, []
    if unsure:
        zeros = ", ".join(f"{one.joint} {1e3 * one.zero:+.0f} mrad" for one in unsure)
        said.append(
            "Inseparable in this log, in which gravity hardly changes: a shifted zero and another droop under gravity, "
            f"by a load or a gain that is off. The fit calls it a zero: {zeros}."
        )
    if held := ", ".join(one.joint for one in unsure if not one.told):
        said.append(f"No poses of one joint change gravity enough there to tell; turn the base round: {held}.")
    if found.shift:
        said.append(
            f"The clocks are apart: {1e3 * found.shift:.1f} ms were taken out first, so that no latency can show."
        )
    if found.baseline is not None and found.baseline.effects:
        names = ", ".join(found.baseline.effects)
        said.append(f"The reference shows it already, so it is no cause but a part of the simulator now: {names}.")
    if exp.noise.source != "repeats":
        said.append("No command was played twice: the noise floor is estimated from the roughness of the log.")
    if exp.noise.unsteady.any():
        names = ", ".join(name for name, is_so in zip(exp.channels, exp.noise.unsteady, strict=True) if is_so)
        said.append(
            f"Repeats of the same commands differ here by far more than elsewhere, which counts as gap: {names}."
        )
    if not exp.by_record:
        said.append("There is one motion only: every second part of it was held out, which is weak evidence.")
    elif len(np.unique(exp.pieces.record[exp.held_out])) < FEW:
        said.append("Few trajectories are held out: intervals are over parts of them and may be too narrow.")
    if not found.trials and found.verdict.causes and not exp.walking:
        said.append("No self-test was made (duels=0): probabilities are those of the fit alone, and too sure.")
    if found.tolerance:
        said.append(
            f"Differences of {1e3 * found.tolerance:.0f} mrad count as noise (tolerance): smaller causes cannot show."
        )
    elif found.verdict.word == "unknown" and found.verdict.remaining > ROUGH:
        said.append(
            "What is left is far above the noise, and everything counts as an outlier: say with tolerance=0.02 [rad] "
            "what does not matter, and the larger causes come out."
        )
    if exp.comparison.shaking.any():
        names = ", ".join(name for name, shakes in zip(exp.channels, exp.comparison.shaking, strict=True) if shakes)
        said.append(f"These joints shake while their commands rest and are judged by the spectrum: {names}.")
    still = [name for k, name in enumerate(exp.joints) if max(np.ptp(r.targets[:, k]) for r in exp.records) < 1e-6]
    if still:
        said.append(
            f"These joints are never commanded to move, so hardly anything can be said of them: {', '.join(still)}."
        )
    stuck = [name for k, name in enumerate(exp.joints) if _stuck(found, k)]
    if stuck:
        said.append(f"These joints are commanded to move and do not: {', '.join(stuck)}. Look at them first.")
    far = far_off(found)
    if far:
        said.append(
            f"The calibration of these joints is far from what robots of one make differ by, so that it may hide a "
            f"cause: {', '.join(far)}."
        )
    said += [f"{effect} would explain much, but {reason}." for effect, reason in found.refuted.items()]
    if found.verdict.in_part:
        said.append(
            f"{100.0 * (1.0 - found.verdict.explained):.0f} % of the excess remains: something else is at work as well."
        )
    return said


def _unexplained(shrunk: Mapping[str, Any], causes: Sequence[Any]) -> list[str]:
    far = unexplained(shrunk) if causes else []
    told = "Not explained, no nearer to the robot than before or farther, in noise floors"
    return [f"{told}: {', '.join(far)}."] if far else []


def _stuck(found: Findings, k: int) -> bool:
    """Whether a joint stays where it is for all that it is commanded."""
    records = found.experiment.records
    asked = max(float(np.ptp(one.targets[:, k])) for one in records)
    moved = max(float(np.ptp(one.position[:, k])) for one in records)
    return asked > ASKED and moved < STUCK * asked


def _replays(found: Findings, before: np.ndarray, after: np.ndarray) -> list[dict[str, Any]]:
    """Return stretches of the held-out records in which the simulator is furthest off, one a joint."""
    exp, n = found.experiment, len(found.experiment.joints)
    cut, first = exp.pieces, exp.pieces.warm_up
    held = exp.held_out
    square = np.mean((((before - cut.real) / exp.comparison.floor)[held, first:, :n]) ** 2, axis=1)
    worst = np.argsort(np.nan_to_num(square, nan=np.inf).max(axis=0))[::-1][:REPLAYS]
    shown = []
    for joint in worst:
        record = cut.record[held[int(np.argmax(square[:, joint]))]]
        windows = np.flatnonzero(cut.record == record)[: SHOWN // (cut.real.shape[1] - first)]
        commands = cut.windows.commands[windows][:, : cut.real.shape[1], :n][:, ::-1]
        parts = {"command": commands, "real": cut.real[windows], "before": before[windows], "after": after[windows]}
        lines = {key: part[:, first:, joint].ravel().tolist() for key, part in parts.items()}
        ticks = (cut.tick[windows][:, None] + first + 1 + np.arange(cut.real.shape[1] - first)).ravel()
        times = (exp.period * ticks).tolist()
        shown.append({"record": exp.records[record].name, "joint": exp.joints[joint], "time": times, **lines})
    return shown


def _self_test(found: Findings) -> dict[str, Any] | None:
    if not found.null_gains and not found.trials:
        return None
    counts: dict[tuple[str, str], int] = {}
    for trial in found.trials:
        key = (" + ".join(trial.truth) or "no effect", " + ".join(trial.answer) or "no effect")
        counts[key] = counts.get(key, 0) + 1
    confusions = [{"truth": truth, "answer": answer, "count": count} for (truth, answer), count in counts.items()]
    cases = len(found.null_gains) + len(found.trials)
    return {"cases": cases, "null_gain": max(found.null_gains, default=None), "confusions": confusions}
