"""The self-test: the diagnosis of logs that the simulator makes of the user's own commands, whose causes are known.

From calibration alone it learns what chance gains; from each surviving cause what is left when that is the truth, and
by how much it then beats the others. These logs are made at another step by another scheme: how far off their causes'
values then come out is part of what a value is uncertain by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gsl.core.plant import Plant
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis, by_cost, name_in_place
from gsl.diagnosis.hypothesis.problem import Ask, Problem
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.log.records import Pieces, Record, cut_pieces, slope
from gsl.diagnosis.options import Chance, Options
from gsl.diagnosis.search.screening import extend
from gsl.diagnosis.settings import VerdictSettings
from gsl.diagnosis.simulate.calibration import draw_shifts, no_shifts
from gsl.diagnosis.simulate.in_the_air import change, play
from gsl.diagnosis.simulate.simulator import Bench

HALF = 0.5  # of a lead: two logs of one cause differ by so much
NULL_LEADS = 4  # that are fitted in a log without an effect: the best of them is what chance gains


@dataclass(frozen=True)
class Trial:
    """One simulated log and what came of it.

    Attributes:
        truth: Effects that made it; empty for calibration alone.
        answer: Effects of the hypothesis that won.
        costs: Held-out cost of each hypothesis that was fitted, in the order of the rivals.
        level: Of the truth.
        levels: Of the truth by joint, shape (n_joints,).
        errors: Of the parameters that were fitted for the truth, shape (n_parameters,).
    """

    truth: tuple[str, ...]
    answer: tuple[str, ...]
    costs: tuple[float, ...]
    level: float
    levels: np.ndarray
    errors: np.ndarray


def relog(
    log: Log,
    plant: Plant,
    step: float,
    rng: np.random.Generator,
    settings: VerdictSettings | None = None,
    *,
    accurate: bool = False,
    carried: bool = False,
) -> tuple[Record, ...]:
    """Return what a plant would have logged to the records' commands, with the floor's noise.

    A scheme of first order is half a step ahead of its commands. Beside positions alone the lag of damping makes up for
    that. A desired speed leaves no such lag: there chance would gain as much as a cause.

    Args:
        log: Whose commands, noise floor and conditions.
        plant: With effects and calibration.
        step: Physics period [s].
        rng: Of starts and noise.
        settings: How a record begins.
        accurate: Whether logs with other commands beside positions are made by a scheme of second order.
        carried: Whether shaking joints take the others along, though they do not shake in this plant.
    """
    how, n = settings or VerdictSettings(), len(log.joints)
    alone, drive = log.records[0].beside is None, log.robot.drive
    paths = [record.targets[0] if alone else record.position[0, drive] for record in log.records]
    starts = [path + how.start * rng.standard_normal(len(path)) for path in paths]
    settle = how.settle if alone else 1  # a speed or a torque that is held for long takes the joints elsewhere
    played = play(
        log.records, plant, starts, step=step, period=log.period, settle=settle, accurate=accurate and not alone
    )
    noise = np.hypot(log.comparison.noise, log.comparison.carried / np.sqrt(2.0) * carried)  # which holds it twice
    noisy = [path[:, :n] + noise * rng.standard_normal((len(path), n)) for path in played]
    return tuple(
        replace(record, position=position, velocity=slope(position, log.period))
        for record, position in zip(log.records, noisy, strict=True)
    )


def repose(log: Log, problem: Problem, truth: Hypothesis, rng: np.random.Generator) -> Problem:
    """Return the problem with a simulated log in the real one's place, made with a calibration drawn anew."""
    simulator = problem.simulator
    shifts = draw_shifts(rng, len(log.joints), simulator.spread)
    plant, step = change(simulator.plant, truth.effects, shifts), simulator.log_step
    made = relog(log, plant, step, rng, accurate=simulator.accurate, carried=not truth.candidates)
    cut = cut_pieces(made, log.robot, log.period, warm_up=log.pieces.warm_up, scored=log.pieces.scored)
    index = {(int(r), int(t)): k for k, (r, t) in enumerate(zip(cut.record, cut.tick, strict=True))}

    def same(part: Pieces) -> Pieces:
        return cut.take(np.array([index[int(r), int(t)] for r, t in zip(part.record, part.tick, strict=True)]))

    train, held_out = (
        Bench(simulator, same(bench.pieces), bench.comparison) for bench in (problem.train, problem.held_out)
    )
    return replace(problem, train=train, held_out=held_out)


def simulate_nulls(log: Log, problem: Problem, none: Hypothesis, options: Options) -> list[Chance]:
    """Return what the best effects gain over calibration in logs without one."""
    chances = []
    for trial in range(options.nulls):
        rng = np.random.default_rng((options.seed, trial, 1))
        fake = repose(log, problem, replace(none, candidates=(), parameters=()), rng)
        base = fake.fit_calibration()
        singles, _ = extend(fake, base, NULL_LEADS)
        base = fake.relax(base, singles)
        gains = [base.cost - single.cost for single in singles]
        frees = [base.fit.prior_cost - single.fit.prior_cost for single in singles]
        freed = max(map(min, zip(gains, frees, strict=True)), default=0.0)
        chances.append(Chance(max(gains, default=0.0), freed, base.level, float(base.levels.max())))
        problem.tick("")
    return chances


def duel(log: Log, problem: Problem, rivals: Sequence[Hypothesis], options: Options) -> list[Trial]:
    """Return what comes of logs whose truth is one of the rivals, each some times, when the rivals are fitted."""
    trials = []
    for k, truth in enumerate(rivals):
        for trial in range(options.duels):
            fake = repose(log, problem, truth, np.random.default_rng((options.seed, trial, 2, k)))
            still = no_shifts(fake.train.joints)
            fits = fake.fit_all([Ask(rival.candidates, rival.start, still) for rival in rivals])
            winner = min(fits, key=by_cost)
            costs, errors = tuple(fit.cost for fit in fits), fits[k].start - truth.start
            trials.append(Trial(truth.names, winner.names, costs, fits[k].level, fits[k].levels, errors))
            problem.tick("")
    return trials


def measure_mistakes(rivals: Sequence[Hypothesis], trials: Sequence[Trial]) -> dict[str, float]:
    """Return the share of each rival's simulated logs that the first hypothesis explains better than their truth does.

    Only logs count in which it is ahead by at least half as much as in the real one: such a lead says nothing here.

    Args:
        rivals: The chosen hypothesis, then the others.
        trials: Of all of them, from `duel`.

    Returns:
        Shares by the effect that a rival has in the place of the chosen one's.
    """
    chosen, shares = rivals[0], {}
    for k, rival in enumerate(rivals[1:], start=1):
        lead = HALF * max(rival.cost - chosen.cost, 0.0)
        own = [trial.costs[k] - trial.costs[0] for trial in trials if trial.truth == rival.names]
        if own:
            shares[name_in_place(chosen, rival)] = float(np.mean(np.array(own) > lead))
    return shares
