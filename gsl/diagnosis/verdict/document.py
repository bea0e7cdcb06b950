"""The diagnosis as a document: what report.json holds, and what the page and the terminal show of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from gsl.core.body import Robot
from gsl.core.slides import levers
from gsl.diagnosis.hypothesis.candidates import AND, Candidate
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis, share_of_excess
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.settings import VerdictSettings
from gsl.diagnosis.simulate.calibration import inertia_unit, no_shifts
from gsl.diagnosis.verdict.caveats import caveats
from gsl.diagnosis.verdict.findings import Findings
from gsl.diagnosis.verdict.localise import cells, find_regimes, horizon, sides
from gsl.diagnosis.verdict.servo_law import Form
from gsl.diagnosis.verdict.servo_terms import TIME
from gsl.diagnosis.verdict.shrinkage import find_unexplained, shrinkage
from gsl.diagnosis.verdict.verdict import Cause, Verdict
from gsl.diagnosis.verdict.zero_or_load import Droop, find_droops
from gsl.effects.effect import describe_confusion, effect_class

RANKED = 12  # hypotheses that are listed
ALL = 0.995  # share of a gap that is written as 100 %
REPLAYS, TICKS = 6, 400  # pictures of replays, and their ticks at most
WORDS = {
    "no_gap": "The simulator and the robot agree as far as noise and a per-joint calibration can tell.",
    "unknown": "There is a gap that no effect of the library explains.",
}


def document(findings: Findings, **about: Any) -> dict[str, Any]:
    """Return the whole document; `about` is what the caller knows besides: data, world_file, report, command, ..."""
    log, answer, simulator, verdict = findings.log, findings.answer, findings.simulator, findings.verdict
    before = simulator.simulate({}, no_shifts(len(log.channels)), log.pieces)
    after = simulator.simulate(answer.effects, answer.fit.shifts, log.pieces)
    z = log.residual(before)
    times, growth = horizon(log, before)
    unsure = find_droops(findings)
    suspects = [_cause(findings, cause) for cause in verdict.causes]
    causes = suspects if verdict.names_causes else []
    shrunk = shrinkage(findings, before, after)
    far = find_unexplained(shrunk, findings.options.verdict) if causes else []
    places = [asdict(cell) for cell in cells(log, z, find_regimes(log, findings.corrected))]
    how_sure = doubt(causes, findings.options.verdict)
    return {
        "verdict": verdict.word,
        "summary": summary(verdict, causes, shrunk, findings.options.verdict),
        "causes": causes,
        "sure": not how_sure,
        "doubt": how_sure,
        "suspects": suspects if verdict.word == "unknown" else [],
        "inseparable": [list(group) for group in verdict.inseparable if causes],
        "droops": [_droop(log.robot, droop) for droop in unsure],
        "where": [place for place in places if place["named"] or place["regime"] == "all"],
        "horizon": {"time": times, "rms": growth},
        "sides": sides(log, z),
        "shrinkage": shrunk,
        "ranking": _ranking(findings),
        "least_gain": findings.selection.least,
        "calibration": _calibration(findings),
        "floor": {
            "source": log.noise.source,
            "pairs": log.noise.pairs,
            "sd": dict(zip(log.channels, (log.comparison.floor * _ways(log)).tolist(), strict=True)),
        },
        "invisible": list(findings.selection.screening.invisible),
        "unexplained": far,
        "slides": [name for name in log.joints if log.robot.joint(name).slides],
        "forms": [_form(log.robot, form) for form in findings.forms],
        "caveats": caveats(findings, unsure, shrunk, far),
        "limits": [],
        "next_experiment": None,
        "policy_gap": None,
        "replays": _replays(findings, before, after),
        "self_test": _self_test(findings),
        **about,
    }


def summary(
    verdict: Verdict, causes: Sequence[Mapping[str, Any]], shrunk: Mapping[str, Any], how: VerdictSettings | None = None
) -> str:
    """Return the result in a sentence or two.

    Args:
        verdict: What the selection allows to say.
        causes: What is said of each cause: effect, scope and probability.
        shrunk: From `shrinkage`.
        how: When a cause is sure.
    """
    if verdict.word in WORDS and not causes:
        return WORDS[verdict.word]
    *most, last = [f"{cause['effect'].replace('_', ' ')}{_of(cause)}" for cause in causes]
    named = f"{', '.join(most)} and {last}" if most else last
    if verdict.word == "inseparable":
        groups = "; ".join(" or ".join(group) for group in verdict.inseparable).replace("_", " ")
        return f"The gap looks like {named}, but this log cannot tell apart: {groups}."
    caused = f"{doubt(causes, how)} caused".lstrip()
    if shrunk["fraction"] is None:
        return f"The gap is {caused} by {named}."
    gone, alone = shrunk["fraction"], max(0.0, shrunk["calibration_fraction"])
    removed = f"A calibration of each joint removes {100.0 * alone:.0f} % of the gap on held-out data"
    if alone >= ALL:  # what it leaves cannot be explained
        return f"{removed} as well, but costs more, its unusual values counted. The gap is {caused} by {named}."
    share = "what" if gone - alone >= 0.5 * (1.0 - alone) else "a part of what"
    return f"{removed}; {share} it leaves is {caused} by {named}; together they remove {100.0 * gone:.0f} %."


def doubt(causes: Sequence[Mapping[str, Any]], how: VerdictSettings | None = None) -> str:
    """Return what the least sure cause needs said: nothing, probably or possibly."""
    least, how = min((cause["probability"] for cause in causes), default=1.0), how or VerdictSettings()
    return "" if least >= how.sure else "probably" if least >= how.even else "possibly"


def _of(cause: Mapping[str, Any]) -> str:
    scope, exempt = cause["scope"], cause.get("exempt")
    where = f"all joints but {', '.join(exempt)}" if exempt else "all joints" if scope == "all" else scope
    return f" of {where}" if where else ""


def _cause(findings: Findings, cause: Cause) -> dict[str, Any]:
    chosen = findings.selection.chosen
    candidate, values = chosen.pairs[cause.index]
    interval = chosen.intervals(findings.widening, findings.scatter)[cause.index]
    sure = cause.probability >= findings.options.verdict.sure
    return {
        "effect": candidate.effect,
        "kind": effect_class(candidate.effect).kind,
        "joints": candidate.joints(findings.log.robot),
        "scope": candidate.scope,
        "exempt": _exempt(findings.log.robot, candidate),
        "fixed": {key: value for key, value in candidate.fixed.items() if key != "joints"},
        "parameters": _parameters(findings.log.robot, candidate, values, interval),
        "probability": cause.probability,
        "gain": {"value": cause.value, "low": cause.low, "high": cause.high},
        "meaning": (effect_class(candidate.effect).__doc__ or "").strip().splitlines()[0],
        "confused": None if sure else describe_confusion(candidate.effect),
    }


def _exempt(robot: Robot, candidate: Candidate) -> list[str]:
    """Return the joints that a list of joints leaves out, where these are fewer than it has."""
    inside = candidate.joints(robot)
    left = [joint for joint in robot.controlled if joint not in inside]
    return left if AND in candidate.scope and 0 < len(left) < len(inside) else []


def _parameters(robot: Robot, candidate: Candidate, values: np.ndarray, interval: np.ndarray) -> dict[str, Any]:
    columns = (candidate.free, candidate.say(robot), values, candidate.neutral, *interval)
    return {
        name: {
            "value": factor * float(value),
            "low": factor * float(low),
            "high": factor * float(high),
            "unit": unit or ("×" if neutral == 1.0 else ""),
        }
        for name, (factor, unit), value, neutral, low, high in zip(*columns, strict=True)
    }


def _ranking(findings: Findings) -> list[dict[str, Any]]:
    selection, rows = findings.selection, []
    best: dict[frozenset[tuple[str, str]], Hypothesis] = {}
    for fit in selection.tried:
        best.setdefault(fit.places, fit)
    for fit in [*best.values()][:RANKED]:
        value, low, high = share_of_excess(fit, selection.none, selection.none, findings.options.search.noise_cost)
        rows.append(
            {
                "effects": list(fit.names),
                "scopes": [candidate.scope for candidate in fit.candidates],
                "parameters": "; ".join(_write(findings.log.robot, *pair) for pair in fit.pairs),
                "gain": {"value": value, "low": low, "high": high},
                "level": fit.level,
                "behind": fit.cost - selection.chosen.cost,
                "passed_over": selection.objection(fit),
            }
        )
    return rows


def _write(robot: Robot, candidate: Candidate, values: np.ndarray) -> str:
    shown = zip(candidate.free, candidate.tell(robot, values), strict=True)
    return ", ".join(f"{name} {value:.3g}" for name, value in shown)


def _ways(log: Log) -> np.ndarray:
    """Return the levers of the joints, and 1 of a base's channels, shape (n_channels,)."""
    ways = np.ones(len(log.channels))
    ways[: len(log.joints)] = levers(log.robot)[: len(log.joints)]
    return ways


def _droop(robot: Robot, droop: Droop) -> dict[str, Any]:
    """Return a droop as the report has it, in metres and newtons where a joint slides."""
    way, mover = robot.joint(droop.joint).lever, robot.joint(droop.mover).lever
    return asdict(droop) | {
        "zero": way * droop.zero,
        "apart": way * droop.apart,
        "ends": [mover * end for end in droop.ends],
        "torques": [torque / way for torque in droop.torques],
    }


def _form(robot: Robot, form: Form) -> dict[str, Any]:
    """Return a form as the report has it, its curve in metres and newtons where the joint slides."""
    way = robot.joint(form.joint).lever
    along = 1.0 if form.form == TIME else way
    return asdict(form) | {"x": [along * x for x in form.x], "y": [y / way for y in form.y]}


def _calibration(findings: Findings) -> list[dict[str, Any]]:
    unit, inertias = findings.log.robot.torque_unit, inertia_unit(findings.uncalibrated.servo)
    ways = levers(findings.log.robot)
    columns = zip(findings.log.joints, findings.shifts.T, inertias, ways, strict=False)  # coupled motors follow
    return [
        {
            "joint": joint,
            "kp": float(np.exp(kp)),
            "kd": float(np.exp(kd)),
            "coulomb": unit * float(coulomb / way),
            "viscous": unit * float(viscous / way**2),
            "zero": float((zero + offset) * way),
            "inertia": float(inertia * rotor / way**2),
        }
        for joint, (kp, kd, coulomb, zero, offset, inertia, viscous), rotor, way in columns
    ]


def _replays(findings: Findings, before: np.ndarray, after: np.ndarray) -> list[dict[str, Any]]:
    """Return stretches of the held-out records in which the simulator is furthest off, one a joint."""
    log, n = findings.log, len(findings.log.joints)
    cut, first, held = log.pieces, log.pieces.warm_up, log.held_out
    square = np.mean((((before - cut.real) / log.comparison.floor)[held, first:, :n]) ** 2, axis=1)
    worst = np.argsort(np.nan_to_num(square, nan=np.inf).max(axis=0))[::-1][:REPLAYS]
    pictures = []
    for joint in worst:
        record = cut.record[held[int(np.argmax(square[:, joint]))]]
        windows = np.flatnonzero(cut.record == record)[: TICKS // cut.scored]
        parts = {"command": cut.targets(n), "real": cut.real, "before": before, "after": after}
        way = log.robot.joint(log.joints[joint]).lever
        lines = {key: (way * part[windows][:, first:, joint]).ravel().tolist() for key, part in parts.items()}
        ticks = (cut.tick[windows][:, None] + first + 1 + np.arange(cut.scored)).ravel()
        times = (log.period * ticks).tolist()
        pictures.append({"record": log.records[record].name, "joint": log.joints[joint], "time": times, **lines})
    return pictures


def _self_test(findings: Findings) -> dict[str, Any] | None:
    if not findings.chances and not findings.trials:
        return None
    counts: dict[tuple[str, str], int] = {}
    for trial in findings.trials:
        key = (" + ".join(trial.truth) or "no effect", " + ".join(trial.answer) or "no effect")
        counts[key] = counts.get(key, 0) + 1
    confusions = [{"truth": truth, "answer": answer, "count": count} for (truth, answer), count in counts.items()]
    cases = len(findings.chances) + len(findings.trials)
    gain = max((chance.gain for chance in findings.chances), default=None)
    return {"cases": cases, "null_gain": gain, "confusions": confusions}
