"""The diagnosis as a document: what report.json holds, and what the page and the terminal show of it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from gsl.core.body import Robot
from gsl.core.setting import settings_of
from gsl.diagnosis import nuisance
from gsl.diagnosis.attribute import NOISE_COST, Hypothesis, share
from gsl.diagnosis.candidates import Candidate
from gsl.diagnosis.caveats import caveats
from gsl.diagnosis.diagnose import Findings
from gsl.diagnosis.droop import droops
from gsl.diagnosis.localise import cells, horizon, regimes, sides
from gsl.diagnosis.select import passed_over
from gsl.diagnosis.shrinkage import shrinkage, unexplained
from gsl.diagnosis.summary import SURE, doubt, summary
from gsl.diagnosis.verdict import Cause
from gsl.effects.effect import confused_with, effect_class

RANKED = 12  # hypotheses that are listed
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
    far = unexplained(shrunk) if causes else []
    places = [asdict(cell) for cell in cells(exp, z, regimes(exp, found.corrected))]
    return {
        "verdict": found.verdict.word,
        "summary": summary(found.verdict, causes, shrunk),
        "causes": causes,
        "sure": not doubt(causes),
        "doubt": doubt(causes),
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
        "unexplained": far,
        "caveats": caveats(found, unsure, shrunk, far),
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
        "confused": None if one.probability >= SURE else confused_with(candidate.effect),
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
            "unit": known[name].unit or ("×" if neutral == 1.0 else ""),
        }
        for name, value, spread, neutral, low, high in zip(
            candidate.free, values, sd, candidate.neutral, *candidate.bounds, strict=True
        )
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
    rotors = nuisance.inertia_unit(found.uncalibrated.servo)
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
