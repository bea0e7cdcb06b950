"""The diagnosis of one log: calibrate, localise, attribute, test oneself, judge."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gsl.core.body import Robot
from gsl.core.plant import Plant
from gsl.core.trajectory import Batch
from gsl.diagnosis import nuisance
from gsl.diagnosis.attribute import Arena, Hypothesis, scopes_of
from gsl.diagnosis.candidates import library
from gsl.diagnosis.experiment import Experiment, experiment, fitting_step
from gsl.diagnosis.on_ground import Walking, jitter_error, restart_error
from gsl.diagnosis.refuted import refuted
from gsl.diagnosis.replay import Effects, Simulator
from gsl.diagnosis.select import Selection, Thresholds, selected
from gsl.diagnosis.self_test import Trial, duels, null_gains
from gsl.diagnosis.transient import Transient, transient
from gsl.diagnosis.verdict import Verdict, judged
from gsl.effects.effect import applied, built, effect_class, names

NOISE_COST = 0.96  # robust cost of a residual that is noise and nothing else
GAIN, CHANCE = 20.0, 1.3  # least gain of an effect, and how far above the best gain of chance it has to be
RIVALS = 3  # hypotheses that duel, at most
ON_FOOT = 0.1  # share of the cost that chance gains on the ground, where no log can be simulated: measured on walks
SCOUTS = 8  # windows of a walk that a screening looks at: a replay in Bullet takes milliseconds
RESTARTS = 40  # windows that measure what a log does not show of a walk
LATENCY, SHIFTS = "command_latency", (0.002, 0.02, 0.05)  # and where a fit of two clocks' shift starts [s]
PUSH = "external_push"
ON_GROUND = ("contact",)  # kinds of effects that a robot in the air cannot show


@dataclass(frozen=True)
class Options:
    """How a diagnosis works.

    Attributes:
        without: Effects that are not candidates.
        most: Effects at once.
        duels: Simulated logs for each surviving cause; 0 tests nothing.
        nulls: Simulated logs without an effect.
        threads: That replay side by side.
        clocks: Whether commands and measurements have one clock; else latency is not claimed.
    """

    without: tuple[str, ...] = ()
    most: int = 3
    duels: int = 2
    nulls: int = 3
    threads: int = 2
    clocks: bool = True


@dataclass(frozen=True)
class Baseline:
    """The nominal as a reference log has it.

    Attributes:
        effects: Which the reference shows already.
        nuisances: Shape (4, n_joints).
        error: What is left of the model's error [rad], shape (n_joints,).
    """

    effects: Effects
    nuisances: np.ndarray
    error: np.ndarray


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
    found = experiment(log, robot, walking=walking)
    if walking:
        simulator = Walking(plant, fitting_step(step, found.period), found.period, workers=options.threads)
        spread = found.pieces.chosen(np.arange(0, len(found.pieces), max(1, len(found.pieces) // RESTARTS)))
        unknown = np.hypot(restart_error(simulator, spread), jitter_error(simulator, spread, np.random.default_rng(0)))
        found = found.with_model_error(unknown)
    baseline, shift = None, 0.0
    if reference is not None:
        tick("calibrating the simulator on the reference")
        baseline = calibrated_on(reference, robot, plant, step, options, tick)
        plant = nuisance.calibrated(applied(plant, built(baseline.effects)), baseline.nuisances)
        found = found.with_model_error(baseline.error)
    if not options.clocks:
        tick("setting the clocks")
        shift = clock_shift(found, plant, step, options, tick)
        plant = applied(plant, built({LATENCY: {"delay": shift}}))
    arena = arena_of(found, plant, step, options, tick)
    none = arena.calibration()
    everything = found.bench(arena.train.simulator, "all")
    if moment := transient(found, everything.residual({}, none.fit.nuisances)):
        arena = arena_of(found, plant, step, options, tick, moment)
    nulls = tuple(known_nulls or ())
    if options.nulls and not nulls and not walking:
        tick("self-test: what chance gains on these commands")
        nulls = tuple(null_gains(found, arena, none, options.nulls, tick))
    chance = ON_FOOT if walking else 0.0
    thresholds = Thresholds(gain=max(GAIN, CHANCE * max(nulls, default=0.0)), share=chance)
    tick("trying the library on the log")
    selection, wrong = _upheld(found, arena, none, thresholds, options)
    survivors = _survivors(selection)
    tick("self-test: can the causes that are left be told apart")
    trials = tuple(duels(found, arena, survivors, options.duels, tick)) if options.duels and not walking else ()
    expected, margins = _expected(selection, trials) * (1.0 + found.noise.slack), _margins(trials, survivors)
    verdict = judged(selection, expected, margins, walking=walking)
    return Findings(found, arena.train.simulator, arena, selection, verdict, nulls, trials, baseline, shift, wrong)


def _upheld(
    found: Experiment, arena: Arena, none: Hypothesis, thresholds: Thresholds, options: Options
) -> tuple[Selection, dict[str, str]]:
    """Search again without the effects that lose their claim to the name; return them with the reasons."""
    wrong: dict[str, str] = {}
    while True:
        selection = selected(arena, thresholds, none, most=options.most)
        reasons = refuted(selection.chosen, found, arena.train.simulator.plant)
        if not reasons:
            return selection, wrong
        wrong |= reasons
        arena = replace(arena, library=tuple(one for one in arena.library if one.effect not in wrong))


def arena_of(
    found: Experiment,
    plant: Plant,
    step: float,
    options: Options,
    tick: Callable[[str], None],
    moment: Transient | None = None,
) -> Arena:
    """Return where hypotheses on a log compete, a push among them if something happens at one moment."""
    simulator = found.simulator(plant, step, options.threads)
    contact = () if found.walking else ON_GROUND
    hidden = [name for name in names() if getattr(effect_class(name), "kind", "") in contact]
    hidden += [] if options.clocks else [LATENCY]
    shaking = bool(found.comparison.shaking.any())
    hidden += [] if moment else [PUSH]
    known = {PUSH: moment._asdict()} if moment else {}
    candidates = library(found.robot, (*options.without, *hidden), known, dense=shaking, floating=found.walking)
    scopes = scopes_of({} if found.walking else found.robot.groups, found.channels, apart=not found.walking)
    scouts = SCOUTS if found.walking else None
    return Arena(found.bench(simulator, "train"), found.bench(simulator, "held_out"), candidates, scopes, tick, scouts)


def clock_shift(found: Experiment, plant: Plant, step: float, options: Options, tick: Callable[[str], None]) -> float:
    """Return by how much measurements lag behind commands [s], as far as a pure shift explains it."""
    arena = arena_of(found, plant, step, replace(options, clocks=True, without=()), tick)
    candidate = next(one for one in arena.library if one.effect == LATENCY)
    still = nuisance.none(arena.train.joints)
    fits = [arena.fitted((candidate,), np.array([start]), still) for start in SHIFTS]
    return float(min(fits, key=lambda one: one.cost).parameters[0][0])


def calibrated_on(
    reference: Batch, robot: Robot, plant: Plant, step: float, options: Options, tick: Callable[[str], None]
) -> Baseline:
    """Fit the nominal to a log without the effect: whatever is found there belongs to the nominal from now on."""
    found = experiment(reference, robot)
    arena = arena_of(found, plant, step, replace(options, without=()), tick)
    chosen = selected(arena, Thresholds(), most=options.most).chosen
    z = arena.held_out.residual(chosen.effects, chosen.fit.nuisances)
    left = np.sqrt(np.maximum(0.0, np.mean(np.minimum(z**2, 25.0), axis=(0, 1)) - 1.0))
    return Baseline(chosen.effects, chosen.fit.nuisances, left * found.comparison.floor)


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


def _expected(found: Selection, trials: Sequence[Trial]) -> float:
    """Return what a residual costs where the chosen hypothesis is the truth."""
    levels = [trial.level for trial in trials if trial.truth == found.chosen.names]
    return max(NOISE_COST, float(np.mean(levels))) if levels else NOISE_COST


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
