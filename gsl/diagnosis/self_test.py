"""The self-test: the diagnosis of logs that the simulator makes of the user's own commands, whose causes are known.

From calibration alone it learns what chance gains; from each surviving cause what is left when that is the truth, and
by how much it then beats the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gsl.core.plant import Plant
from gsl.diagnosis import nuisance
from gsl.diagnosis.attribute import Arena, Hypothesis
from gsl.diagnosis.experiment import Experiment
from gsl.diagnosis.options import Options
from gsl.diagnosis.records import Pieces, Record, pieces, same, slope
from gsl.diagnosis.replay import Bench
from gsl.effects.effect import applied, built
from gsl.worlds.held import Held

SETTLE = 25  # ticks for which the first command is held before a record begins
START = 0.02  # spread of the joints before that [rad]


@dataclass(frozen=True)
class Trial:
    """One simulated log and what came of it.

    Attributes:
        truth: Effects that made it; empty for calibration alone.
        answer: Effects of the hypothesis that won.
        costs: Held-out cost of each hypothesis that was fitted, in the order in which they were given.
        level: Of the truth.
    """

    truth: tuple[str, ...]
    answer: tuple[str, ...]
    costs: tuple[float, ...]
    level: float


def simulated(found: Experiment, plant: Plant, step: float, rng: np.random.Generator) -> tuple[Record, ...]:
    """Return what a plant would have logged to the records' commands, with the floor's noise.

    Args:
        found: The log.
        plant: With effects and nuisances.
        step: Physics period [s].
        rng: Of starts and noise.
    """
    paths, n = [one.targets for one in found.records], len(found.joints)
    starts = [path[0] + START * rng.standard_normal(path.shape[1]) for path in paths]
    played = [np.zeros(0)] * len(paths)
    for group in same([one.conditions for one in found.records]):
        held = Held.of(applied(plant, built(found.records[group[0]].conditions)), step, found.period)
        some = held.play([paths[k] for k in group], [starts[k] for k in group], SETTLE)
        for k, told in zip(group, some, strict=True):
            played[k] = told
    noisy = [told[:, :n] + found.comparison.floor * rng.standard_normal((len(told), n)) for told in played]
    return tuple(
        replace(one, position=position, velocity=slope(position, found.period))
        for one, position in zip(found.records, noisy, strict=True)
    )


def relogged(found: Experiment, arena: Arena, effects: Hypothesis, rng: np.random.Generator) -> Arena:
    """Return the arena with a simulated log in the real one's place, made with fresh nuisances."""
    simulator = arena.train.simulator
    plant = nuisance.calibrated(
        applied(simulator.plant, built(effects.effects)), nuisance.drawn(rng, len(found.joints), simulator.spread)
    )
    made = simulated(found, plant, simulator.step, rng)
    length = found.pieces.real.shape[1]
    cut = pieces(made, found.robot, found.period, warm_up=found.pieces.warm_up, scored=length - found.pieces.warm_up)
    index = {(int(r), int(t)): k for k, (r, t) in enumerate(zip(cut.record, cut.tick, strict=True))}

    def same(part: Pieces) -> Pieces:
        return cut.chosen(np.array([index[int(r), int(t)] for r, t in zip(part.record, part.tick, strict=True)]))

    benches = [Bench(simulator, same(one.pieces), one.comparison) for one in (arena.train, arena.held_out)]
    return replace(arena, train=benches[0], held_out=benches[1])


def null_gains(
    found: Experiment, arena: Arena, none: Hypothesis, options: Options, tick: Callable[[str], None]
) -> list[float]:
    """Return the best gains over calibration in logs without an effect."""
    gains = []
    for trial in range(options.nulls):
        rng = np.random.default_rng((options.seed, trial, 1))
        fake = relogged(found, arena, replace(none, candidates=(), parameters=()), rng)
        base = fake.calibration()
        singles, _ = fake.successors(base, 4)
        gains.append(base.cost - singles[0].cost if singles else 0.0)
        tick("")
    return gains


def duels(
    found: Experiment, arena: Arena, rivals: Sequence[Hypothesis], options: Options, tick: Callable[[str], None]
) -> list[Trial]:
    """Return what comes of logs whose truth is one of the rivals, each some times, when the rivals are fitted."""
    trials = []
    for k, truth in enumerate(rivals):
        for trial in range(options.duels):
            fake = relogged(found, arena, truth, np.random.default_rng((options.seed, trial, 2, k)))
            fits = [_refitted(fake, one) for one in rivals]
            winner = min(fits, key=lambda one: one.cost)
            costs = tuple(one.cost for one in fits)
            trials.append(Trial(truth.names, winner.names, costs, fits[k].level))
            tick("")
    return trials


def _refitted(arena: Arena, one: Hypothesis) -> Hypothesis:
    start = np.concatenate([np.zeros(0), *one.parameters])
    return arena.fitted(one.candidates, start, nuisance.none(arena.train.joints))
