"""Baselines: four ways in which others look for a missing effect, on the same logs, library and simulator.

They get less work than the diagnosis, no held-out data, no self-test and no verdict but this: where next to nothing is
gained they say that there is no gap. None of them can abstain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from gsl.diagnosis.hypothesis.candidates import Candidate, effects_of
from gsl.diagnosis.hypothesis.problem import Problem
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.log.records import cut_pieces
from gsl.diagnosis.search.screening import Ground, Lead, screen_candidates
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.simulator import Bench
from gsl_benchmarks.blind.rules import apply_rules

GAIN, SHIFT = 20.0, 0.02  # in units of cost, or as a share of a range: less is nothing
STEPS = 400  # control periods that a one-step fit looks at
EVALUATIONS = 10  # of the joint fit, each with all its derivatives
PROBE = 0.02  # of its derivatives, as a share of a range
FAR = 50.0  # floors beyond which it does not look at a residual

Answer = dict[str, Any]


def least_error_one_step(log: Log, arena: Problem) -> Answer:
    """Return the effect with which the simulator best predicts one control period from the measured state."""
    period, robot = log.period, log.robot
    held = {int(k) for k in log.pieces.record[log.held_out]}
    kept = [record for k, record in enumerate(log.records) if k not in held] if log.by_record else list(log.records)
    cut = cut_pieces(kept, robot, period, warm_up=0, scored=1)
    spread = np.unique(np.linspace(0, len(cut) - 1, min(STEPS, len(cut))).round().astype(int))
    calm = replace(log.comparison, shaking=np.zeros_like(log.comparison.shaking))
    return _least(Bench(arena.train.simulator, cut.take(spread), calm), arena)


def least_training_error(log: Log, arena: Problem) -> Answer:
    """Return the effect whose replays of the training windows are nearest to the log, nuisances free."""
    return _least(arena.train, arena)


def _least(bench: Bench, arena: Problem) -> Answer:
    ground = Ground.of(bench, {})
    leads = screen_candidates(ground, arena.library, arena.scopes, arena.tick, arena.settings).leads
    if not leads or leads[0].cost > float(ground.costs.sum()) - GAIN:
        return _answer("no_gap", [])
    ranking = [{"effects": [lead.candidate.effect]} for lead in leads[:20]]
    return _answer("causes", [_cause(arena, leads[0])], ranking)


def everything_at_once(log: Log, arena: Problem) -> Answer:
    """Return the effect that moves furthest in its documented range when all are fitted together, on all joints.

    Effects with several parameters have one of them fitted at a time, and stiction, which has no size alone, none.
    """
    library = [candidate for candidate in arena.library if len(candidate.free) == 1]
    start, reach = (
        np.array([candidate.neutral[0] for candidate in library]),
        np.array([_reach(candidate) for candidate in library]),
    )
    ends = np.sort(
        [(candidate.documented[:, 0] - candidate.neutral[0]) / _reach(candidate) for candidate in library], axis=1
    ).T
    none = no_shifts(arena.train.joints)

    def residual(shifted: np.ndarray) -> np.ndarray:
        values = [np.array([value]) for value in start + np.clip(shifted - 1.0, *ends) * reach]
        return np.tanh(arena.train.residual(effects_of(library, values), none).ravel() / FAR)

    around = 1.0 + ends + [[-1e-9], [1e-9]]
    fitted = (
        least_squares(
            residual, np.ones(len(library)), bounds=around, diff_step=PROBE, x_scale="jac", max_nfev=EVALUATIONS
        ).x
        - 1
    )
    order = np.argsort(-np.abs(fitted))
    if abs(fitted[order[0]]) < SHIFT:
        return _answer("no_gap", [])
    leads = [Lead(library[k], np.array([start[k] + fitted[k] * reach[k]]), none, 0.0) for k in order]
    return _answer("causes", [_cause(arena, leads[0])], [{"effects": [lead.candidate.effect]} for lead in leads])


def _reach(candidate: Candidate) -> float:
    ends = candidate.documented[:, 0] - candidate.neutral[0]
    return float(ends[np.argmax(np.abs(ends))])


def rule_table(log: Log, arena: Problem) -> Answer:
    """Return the effect that a table of rules reads off lags, static errors, hysteresis and saturation."""
    effects, joints = apply_rules(log, arena)
    if not effects:
        return _answer("no_gap", [])
    cause: Answer = {"effect": effects[0], "joints": joints, "fixed": {}, "parameters": {}, "probability": None}
    return _answer("causes", [cause], [{"effects": [name]} for name in effects])


BASELINES: Mapping[str, Callable[[Log, Problem], Answer]] = {
    "one_step": least_error_one_step,
    "everything": everything_at_once,
    "training_error": least_training_error,
    "rules": rule_table,
}


def _answer(verdict: str, causes: Sequence[Answer], ranking: Sequence[Answer] = ()) -> Answer:
    return {"verdict": verdict, "causes": list(causes), "inseparable": [], "ranking": list(ranking)}


def _cause(arena: Problem, lead: Lead) -> Answer:
    candidate = lead.candidate
    mask = arena.scopes.get(candidate.scope) if candidate.on_joints else None
    single = [name for name, own in arena.scopes.items() if own.sum() == 1]
    joints = [] if mask is None else [name for name in single if (arena.scopes[name] & mask).any()]
    return {
        "effect": candidate.effect,
        "joints": joints,
        "scope": candidate.scope,
        "fixed": {key: value for key, value in candidate.fixed.items() if key != "joints"},
        "parameters": {key: {"value": float(v)} for key, v in zip(candidate.free, lead.parameters, strict=True)},
        "probability": None,
    }
