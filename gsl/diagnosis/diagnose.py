"""The diagnosis of one log: calibrate, search, test oneself, judge."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.plant import Plant
from gsl.core.trajectory import Batch
from gsl.diagnosis.angles import with_log_in_angles
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis, name_in_place
from gsl.diagnosis.hypothesis.problem import LATENCY, Problem
from gsl.diagnosis.log.files import on_ground
from gsl.diagnosis.log.log import Log, cut_log
from gsl.diagnosis.options import Chance, Options
from gsl.diagnosis.search.looks import look
from gsl.diagnosis.search.plausibility import find_idle, refute
from gsl.diagnosis.search.reference import Nominal, calibrate_on, clock_shift
from gsl.diagnosis.search.selection import Selection, Thresholds
from gsl.diagnosis.search.stepwise import Search
from gsl.diagnosis.search.zeros import SHIFTS
from gsl.diagnosis.settings import VerdictSettings
from gsl.diagnosis.simulate.in_the_air import change
from gsl.diagnosis.simulate.on_ground import Walking, model_error
from gsl.diagnosis.simulate.simulator import Bench
from gsl.diagnosis.verdict.findings import Findings
from gsl.diagnosis.verdict.self_test import Trial, duel, measure_mistakes, simulate_nulls
from gsl.diagnosis.verdict.servo_law import find_forms, learn_laws
from gsl.diagnosis.verdict.verdict import Judge
from gsl.errors import InputError
from gsl.worlds.fits import fitting_step


def diagnose(
    batch: Batch,
    plant: Plant,
    step: float,
    options: Options,
    tick: Callable[[str], None],
    *,
    reference: Batch | None = None,
) -> Findings:
    """Diagnose a log.

    Args:
        batch: Checked against the contract; of the plant's robot.
        plant: The simulator.
        step: Its physics period [s].
        options: How.
        tick: Called with a phase when it begins, and with an empty word whenever some work is done.
        reference: A log without the effect, on which the nominal is calibrated first.
    """
    if reference is not None:
        reference = with_log_in_angles(reference, plant)[0]
    batch, plant = with_log_in_angles(batch, plant)
    nominal, baseline, shift = Nominal(plant, step), None, 0.0
    log = _widen_floor(prepare(batch, lump(plant.robot), options), nominal, options)
    if reference is not None:
        tick("calibrating the simulator on the reference")
        baseline = calibrate_on(_prepare_reference(reference, log.robot, options), nominal, options, tick)
        log, nominal, options = baseline.take_out(log, nominal, options)
    if not options.clocks:
        tick("setting the clocks")
        shift = clock_shift(log, nominal, options, tick)
        nominal = nominal._replace(plant=change(nominal.plant, {LATENCY: {"delay": shift}}))
    problem, none = _pose(log, nominal, options, tick)
    chances = options.chances
    if options.nulls and not chances and not log.walking:
        tick("self-test: what chance gains on these commands")
        chances = tuple(simulate_nulls(log, problem, none, options))
    tick("trying the library on the log")
    selection, refuted = _search(log, problem, none, chances, options)
    rivals, trials = _survivors(selection, options.verdict), []
    tick("what a law of any servo would explain")
    chosen = selection.chosen
    laws = learn_laws(log, problem.simulator, chosen.effects, chosen.fit.shifts, options.verdict.law)
    missing = laws.missing if laws else 0.0
    if options.duels and not log.walking and chosen.candidates:
        tick("self-test: can the causes that are left be separated")
        trials = duel(log, problem, rivals, options)
    verdict = _judge(log, rivals, trials, chances, options).judge(selection, missing)
    lacking = verdict.word == "unknown" and missing > 1.0
    forms = find_forms(log, problem.simulator, options.verdict.law) if lacking else ()
    tested = chances, tuple(trials)
    return Findings(log, problem, selection, verdict, *tested, baseline, shift, refuted, laws, forms, options)


def prepare(batch: Batch, robot: Robot, options: Options) -> Log:
    """Return a batch as a log, with what does not matter of its joints counted as noise."""
    log = cut_log(batch, robot, walking=on_ground(batch), held_out=options.held_out, blocks=True)
    ours = np.arange(len(log.channels)) < len(log.joints)
    return log.with_model_error(np.where(ours, options.tolerance, 0.0)) if options.tolerance else log


def _prepare_reference(batch: Batch, robot: Robot, options: Options) -> Log:
    """Return a reference as a log, of which no label holds a part out; refuse one of too few windows."""
    log = prepare(batch, robot, replace(options, held_out={}))
    _check_parts(log, "the reference has ")
    return log


def _check_parts(log: Log, whose: str = "") -> None:
    if not len(log.train) or not len(log.held_out):
        raise InputError(
            f"{whose}too little to fit and to check: two motions, or one trajectory, of some seconds are the least"
        )


def _widen_floor(log: Log, nominal: Nominal, options: Options) -> Log:
    """Refuse a log of too few windows; add to the floor of a walk what its log does not show."""
    _check_parts(log)
    if not log.walking:
        return log
    step = fitting_step(nominal.step, log.period)
    simulator = Walking(nominal.plant, step, log.period, workers=options.threads)
    every = max(1, len(log.pieces) // options.search.restarts)
    some = log.pieces.take(np.arange(0, len(log.pieces), every))
    return log.with_model_error(model_error(simulator, some, np.random.default_rng(0)))


def _pose(log: Log, nominal: Nominal, options: Options, tick: Callable[[str], None]) -> tuple[Problem, Hypothesis]:
    """Return the problem with what a look at the training windows says, and calibration alone."""
    problem = nominal.problem(log, options, tick)
    none = problem.fit_calibration()
    seen = log.only_train()  # a look fits as well: held-out windows take no part
    left = Bench(problem.simulator, seen.pieces, seen.comparison).residual({}, none.fit.shifts)
    return Problem.of(log, problem.simulator, options, tick, look(seen, left)), none


def _search(
    log: Log, problem: Problem, none: Hypothesis, chances: Sequence[Chance], options: Options
) -> tuple[Selection, dict[str, str]]:
    """Search again without the effects that lose their claim to the name; return them with the reasons."""
    how = options.search
    share = how.walk_share if log.walking else how.shaking_share * log.shaking_share
    thresholds = Thresholds.of(chances, how, share)
    width = 1 if log.walking else how.beam  # a replay in Bullet takes milliseconds
    refuted: dict[str, str] = {}
    while True:
        search = Search(problem, none, thresholds, options.most, width)
        selection = search.select()
        reasons = refute(selection.chosen, log, problem.simulator.plant, options.plausibility)
        if not (log.walking or log.shaking_share):  # where derivatives mean little, so do intervals
            remaining = selection.chosen.level / (how.noise_cost * (1.0 + log.noise.slack))
            idle = find_idle(selection.chosen, options.verdict.widening(remaining), log.robot)
            upheld = search.uphold(selection.chosen) if set(idle) & set(SHIFTS) else set()
            reasons |= {name: reason for name, reason in idle.items() if name not in upheld}
        if not reasons:
            selection = search.look_again(selection)
            problem.memory.clear()
            return selection, refuted
        refuted |= reasons
        problem = problem.without(refuted)


def _survivors(selection: Selection, how: VerdictSettings) -> list[Hypothesis]:
    """Return the chosen hypothesis and the best ones of as many effects with other names."""
    chosen, survivors = selection.chosen, [selection.chosen]
    behind = max(how.behind, how.behind_share * (selection.none.cost - chosen.cost))
    for rival in selection.rivals if chosen.candidates else ():
        other = set(rival.names) not in [set(kept.names) for kept in survivors]
        near = rival.cost < min(selection.none.cost, chosen.cost + behind)
        if rival.size == chosen.size and other and near and len(survivors) < how.survivors:
            survivors.append(rival)
    return survivors


def _judge(
    log: Log, rivals: Sequence[Hypothesis], trials: Sequence[Trial], chances: Sequence[Chance], options: Options
) -> Judge:
    """Return who judges a log, with what simulated logs say of the cost of noise and of differences by chance."""
    how, noise_cost = options.verdict, options.search.noise_cost
    own = [trial for trial in trials if trial.truth == rivals[0].names]
    least = 0.0 if log.shaking_share else noise_cost  # rows of a joint that shakes are not scaled to cost as noise does
    expected = max(least, float(np.mean([trial.level for trial in own]))) if own else noise_cost
    worst = 1.0
    if chances and not rivals[0].candidates:  # what a calibration leaves of few motions, though there is no gap
        expected = max(expected, float(np.median([done.level for done in chances])))
        worst = max(worst, float(np.median([done.worst for done in chances])))
    return Judge(
        expected * (1.0 + log.noise.slack),
        worst,
        _margins(rivals, own),
        measure_mistakes(rivals, trials),
        how.walk_doubt if log.walking else how.shaking_doubt * log.shaking_share,
        log.walking,
        not log.by_record and log.motions == 1,
        log.noise.source != "repeats" and not options.tolerance,
        how,
        noise_cost,
        _find_odd(log, rivals[0], own, how),
    )


def _find_odd(log: Log, chosen: Hypothesis, own: Sequence[Trial], how: VerdictSettings) -> dict[str, float]:
    """Return how oddly joints shake, by name: how much more than in logs of the hypothesis is left, 1 if too much."""
    if not own or not log.comparison.shaking.any():
        return {}
    usual = np.max([trial.levels for trial in own], axis=0)
    ratios = np.log(chosen.levels / usual) / np.log(how.odd)
    loud = np.flatnonzero(log.comparison.shaking & (chosen.levels > how.loud))
    return {log.channels[k]: float(ratios[k]) for k in loud}


def _margins(rivals: Sequence[Hypothesis], own: Sequence[Trial]) -> dict[str, float]:
    """Return how much the difference of costs to each rival varies where the chosen hypothesis is the truth."""
    if len(own) < 2:
        return {}
    chosen = rivals[0]
    spreads = np.std([[cost - trial.costs[0] for cost in trial.costs[1:]] for trial in own], axis=0, ddof=1)
    names = [name_in_place(chosen, rival) for rival in rivals[1:]]
    return {name: float(value) for name, value in zip(names, spreads, strict=True)}
