"""The diagnosis of one log: calibrate, localise, attribute, test oneself, judge."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gsl.core.body import Robot
from gsl.core.plant import Plant
from gsl.core.trajectory import Batch
from gsl.diagnosis import nuisance
from gsl.diagnosis.arena import LATENCY, arena_of, looked_at
from gsl.diagnosis.attribute import BEAM, NOISE_COST, Arena, Hypothesis
from gsl.diagnosis.experiment import Experiment, experiment
from gsl.diagnosis.on_ground import Walking, model_error
from gsl.diagnosis.options import Options
from gsl.diagnosis.reference import Baseline, calibrated_on, clock_shift
from gsl.diagnosis.refuted import refuted
from gsl.diagnosis.replay import Simulator
from gsl.diagnosis.select import Selection, Thresholds, selected
from gsl.diagnosis.self_test import Trial, duels, null_gains
from gsl.diagnosis.verdict import Verdict, judged
from gsl.effects.effect import applied, built
from gsl.errors import InputError
from gsl.worlds.fits import fitting_step

GAIN, CHANCE = 20.0, 1.3  # least gain of an effect, and how far above the best gain of chance it has to be
RIVALS = 3  # hypotheses that duel, at most
ON_FOOT = 0.1  # share of the cost that chance gains on the ground, where no log can be simulated: measured on walks
SHAKING = 0.1  # the same of joints that shake: their phase is chance
DOUBT_ON_FOOT, DOUBT = (
    0.05,
    0.08,
)  # share of the cost by which two causes differ by chance, there and of joints that shake
WIDER = 2.0  # than white noise makes intervals: what is left of a joint hangs together in time. Estimate
RESTARTS = 40  # windows that measure what a log does not show of a walk


@dataclass(frozen=True)
class Findings:
    """All that a diagnosis found.

    Attributes:
        experiment: The log.
        simulator: As the user has it, calibrated on the reference if there is one.
        arena: Where hypotheses competed.
        selection: What came of it.
        verdict: What can be said.
        null_gains: What chance gained in simulated logs.
        trials: Duels of the surviving causes in simulated logs.
        baseline: From the reference, if there is one.
        shift: Between the clocks of commands and measurements, taken out first [s], if they are apart.
        refuted: Effects that fitted but lost their claim to the name, with the reason.
        seed: Of what was drawn.
        tolerance: Difference of a joint that does not matter [rad].
    """

    experiment: Experiment
    simulator: Simulator
    arena: Arena
    selection: Selection
    verdict: Verdict
    null_gains: tuple[float, ...]
    trials: tuple[Trial, ...]
    baseline: Baseline | None
    shift: float = 0.0
    refuted: Mapping[str, str] = field(default_factory=dict)
    seed: int = 0
    tolerance: float = 0.0

    @property
    def uncalibrated(self) -> Plant:
        """The simulator's robot with the answer's effects."""
        return applied(self.simulator.plant, built(self.answer.effects))

    @property
    def corrected(self) -> Plant:
        """The simulator's robot with the answer's effects and calibration."""
        return nuisance.calibrated(self.uncalibrated, self.answer.fit.nuisances[:, : len(self.experiment.joints)])

    @property
    def widening(self) -> float:
        """How much wider an interval is than noise alone makes it: what is left unexplained widens it."""
        return float(WIDER * np.sqrt(max(1.0, self.verdict.remaining)))

    @property
    def answer(self) -> Hypothesis:
        """The hypothesis that may be used: the chosen one if it may be named, else calibration alone."""
        return self.selection.chosen if self.verdict.word in ("causes", "inseparable") else self.selection.none


def diagnosed(
    log: Batch,
    robot: Robot,
    plant: Plant,
    step: float,
    options: Options,
    tick: Callable[[str], None],
    *,
    reference: Batch | None = None,
    walking: bool = False,
    known_nulls: Sequence[float] | None = None,
) -> Findings:
    """Diagnose a log.

    Args:
        log: Checked against the contract; of `robot`.
        robot: Without fixed joints.
        plant: The simulator.
        step: Its physics period [s].
        options: How.
        tick: Called with a phase when it begins, and with an empty word whenever some work is done.
        walking: Whether the robot is on the ground.
        reference: A log without the effect, on which the nominal is calibrated first.
        known_nulls: What chance gained on these commands in this world, if it is known already.
    """
    found = prepared(log, robot, options, walking=walking)
    if not len(found.train) or not len(found.held_out):
        raise InputError(
            "too little to fit and to check: two motions, or one trajectory, of some seconds are the least"
        )
    if walking:
        simulator = Walking(plant, fitting_step(step, found.period), found.period, workers=options.threads)
        spread = found.pieces.chosen(np.arange(0, len(found.pieces), max(1, len(found.pieces) // RESTARTS)))
        found = found.with_model_error(model_error(simulator, spread, np.random.default_rng(0)))
    baseline, shift = None, 0.0
    if reference is not None:
        tick("calibrating the simulator on the reference")
        baseline = calibrated_on(reference, robot, plant, step, options, tick)
        found, plant, options = baseline.taken_out(found, plant, options)
    if not options.clocks:
        tick("setting the clocks")
        shift = clock_shift(found, plant, step, options, tick)
        plant = applied(plant, built({LATENCY: {"delay": shift}}))
    arena = arena_of(found, plant, step, options, tick)
    none = arena.calibration()
    seen = replace(found, pieces=found.pieces.chosen(found.train))  # a look fits as well: held-out windows take no part
    left = seen.bench(arena.train.simulator, "all").residual({}, none.fit.nuisances)
    arena = arena_of(found, plant, step, options, tick, looked_at(seen, left))
    nulls = tuple(known_nulls or ())
    if options.nulls and not nulls and not walking:
        tick("self-test: what chance gains on these commands")
        nulls = tuple(null_gains(found, arena, none, options, tick))
    shaking = _shaking(found)
    chance = ON_FOOT if walking else SHAKING * shaking
    doubt = DOUBT_ON_FOOT if walking else DOUBT * shaking
    thresholds = Thresholds(max(GAIN, CHANCE * max(nulls, default=0.0)), chance)
    tick("trying the library on the log")
    selection, wrong = _upheld(found, arena, none, thresholds, options)
    survivors = _survivors(selection)
    trials: tuple[Trial, ...] = ()
    if options.duels and not walking and survivors[0].candidates:
        tick("self-test: can the causes that are left be told apart")
        trials = tuple(duels(found, arena, survivors, options, tick))
    expected = _expected(selection, trials, shakes=shaking > 0.0) * (1.0 + found.noise.slack)
    verdict = judged(selection, expected, _margins(trials, survivors), doubt, walking=walking, lone=not found.by_record)
    return Findings(
        found, arena.train.simulator, arena, selection, verdict, nulls, trials, baseline, shift, wrong, options.seed,
        options.tolerance,
    )  # fmt: skip


def prepared(log: Batch, robot: Robot, options: Options, *, walking: bool = False) -> Experiment:
    """Return a log ready for counterfactuals, with what does not matter of its joints counted as noise."""
    found = experiment(log, robot, walking=walking, held_out=options.held_out)
    ours = np.arange(len(found.channels)) < len(found.joints)
    return found.with_model_error(np.where(ours, options.tolerance, 0.0)) if options.tolerance else found


def _shaking(found: Experiment) -> float:
    """Return the share of the residuals that are of joints that shake."""
    used = found.comparison.used(found.pieces.real.shape[1] - found.pieces.warm_up)
    return float(used[found.comparison.shaking].sum() / used.sum())


def _upheld(
    found: Experiment, arena: Arena, none: Hypothesis, thresholds: Thresholds, options: Options
) -> tuple[Selection, dict[str, str]]:
    """Search again without the effects that lose their claim to the name; return them with the reasons."""
    wrong: dict[str, str] = {}
    width = 1 if found.walking else BEAM  # a replay in Bullet takes milliseconds
    while True:
        selection = selected(arena, thresholds, none, most=options.most, width=width)
        reasons = refuted(selection.chosen, found, arena.train.simulator.plant)
        if not reasons:
            return _looked_again(arena, selection, thresholds), wrong
        wrong |= reasons
        arena = replace(arena, library=tuple(one for one in arena.library if one.effect not in wrong))


def _looked_again(arena: Arena, found: Selection, thresholds: Thresholds) -> Selection:
    """Return a selection that knows what is invisible on top of the chosen hypothesis.

    Where joints shake or a robot walks another look costs too much: there it is what the plain simulator does not show.
    """
    if thresholds.share or not found.chosen.candidates:
        return found
    return replace(found, screening=replace(found.screening, invisible=arena.screening(found.chosen).invisible))


def _survivors(found: Selection) -> list[Hypothesis]:
    """Return the chosen hypothesis and the best ones of as many effects with other names."""
    chosen, survivors = found.chosen, [found.chosen]
    if not chosen.candidates:
        return survivors
    for one in found.tried:
        other = set(one.names) not in [set(kept.names) for kept in survivors]
        near = one.cost - chosen.cost < max(200.0, 0.1 * (found.none.cost - chosen.cost))
        if len(one.candidates) == len(chosen.candidates) and other and near and len(survivors) < RIVALS:
            survivors.append(one)
    return survivors


def _expected(found: Selection, trials: Sequence[Trial], *, shakes: bool) -> float:
    """Return what a residual costs where the chosen hypothesis is the truth."""
    levels = [trial.level for trial in trials if trial.truth == found.chosen.names]
    least = 0.0 if shakes else NOISE_COST  # the rows of a joint that shakes are not scaled to cost as much as noise
    return max(least, float(np.mean(levels))) if levels else NOISE_COST


def _margins(trials: Sequence[Trial], survivors: Sequence[Hypothesis]) -> list[tuple[str, float]]:
    """Return how much the difference of costs to each rival varies where the chosen hypothesis is the truth."""
    own = [trial.costs for trial in trials if trial.truth == survivors[0].names]
    if len(own) < 2:
        return []
    spread = np.std([[cost - costs[0] for cost in costs[1:]] for costs in own], axis=0, ddof=1)
    return [
        (next((name for name in one.names if name not in survivors[0].names), one.names[-1]), float(value))
        for one, value in zip(survivors[1:], spread, strict=True)
    ]
