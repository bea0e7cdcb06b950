"""What methods came to over their trials, how they differ, and what can be said of their order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import wilcoxon

from gsl.core.statistics import Interval, mean_interval
from gsl_experiments.trial import Cell, Trial

Figure = Callable[[Trial], Any]  # of a trial
IMPROVEMENT: Figure = attrgetter("plausible_improvement")


class Summary(NamedTuple):
    """All trials of a cell; improvement and rank are means over trials [%, -], None where a trial has none to tell.

    The generation is that which found what was returned, on average over trials that returned something new, if any.
    `without` counts trials in which what was returned fell or was not surely better; `unimproved` those in which no
    winner improved, which the paper counts as failures ("failed to produce a stable improvement", section 6.4).
    """

    simulator: str
    world: str
    method: str
    iteration: int
    trials: int
    value: Interval
    improvement: Interval | None
    without: int
    unimproved: int
    stable: int
    improving: int
    winners: int
    generation: float | None
    falls: int
    refused: int
    rank: float | None
    real_episodes: float

    @property
    def best_generation(self) -> str:
        """The generation as a cell of a table."""
        return "" if self.generation is None else f"{self.generation:.1f}"

    def cells(self, fields: Mapping[str, str]) -> list[str]:
        """Return some fields, told by title, as cells of a table."""
        return [str(getattr(self, name)) for name in fields.values()]

    def own(self, trials: Sequence[Trial]) -> list[Trial]:
        """Return those of some trials that it sums up."""
        return [trial for trial in trials if trial.cell == self[:4]]


def summaries(trials: Sequence[Trial]) -> list[Summary]:
    """Return one summary for each cell, by worlds, methods in the order of their first trial."""
    cells = sorted(dict.fromkeys(trial.cell for trial in trials), key=lambda cell: cell[:2])
    return [_summary(cell, [trial for trial in trials if trial.cell == cell]) for cell in cells]


def differences(trials: Sequence[Trial], cell: Cell, other: str, figure: Figure = IMPROVEMENT) -> Interval:
    """Return how much larger a figure is than another method's, paired by trial, with its 95 % interval."""
    return mean_interval(np.subtract(*_pair(trials, cell, other, figure)))


class Order(NamedTuple):
    """Two methods by the stable winners of their generations.

    Attributes:
        method, other: Their names.
        difference: Mean over trials of the difference in stable winners.
        p: Two-sided Wilcoxon signed-rank test over trials, Holm-corrected over the pairs that are tested in a world.
    """

    method: str
    other: str
    difference: float
    p: float


def orders(
    trials: Sequence[Trial], simulator: str, world: str, methods: Sequence[str], others: Sequence[str]
) -> list[Order]:
    """Return how methods stand to others in a world, as far as both were tried there, after one iteration.

    The test was fixed before any study, its pairs on 2026-11-22, before table 2 and after a first comparison of five
    trials: with ten the least p is .002, which is none any more after a correction for all pairs of seventeen methods.
    """
    there = {trial.method for trial in trials if trial.cell[:2] == (simulator, world)}
    pairs = []
    for method, other in product(methods, others):
        if not {method, other} <= there or method == other:
            continue
        first, second = _pair(trials, Cell(simulator, world, method, 1), other, attrgetter("stable"))
        apart = first - second
        p = float(wilcoxon(apart).pvalue) if apart.any() else 1.0
        pairs.append(Order(method, other, float(np.mean(apart)), p))
    return _correct(pairs)


def _pair(trials: Sequence[Trial], cell: Cell, other: str, figure: Figure) -> tuple[np.ndarray, np.ndarray]:
    """Return a figure of two methods in the trials that both have, shape (trials,) each."""
    values = {
        name: {trial.number: figure(trial) for trial in trials if trial.cell == cell._replace(method=name)}
        for name in (cell.method, other)
    }
    numbers = sorted(values[cell.method].keys() & values[other].keys())
    first, second = (np.array([values[name][number] for number in numbers], float) for name in (cell.method, other))
    return first, second


def _correct(orders: Sequence[Order]) -> list[Order]:
    """Holm's correction: the k-th least of n p-values times n - k + 1, none less than one before it."""
    p = np.array([order.p for order in orders])
    order = np.argsort(p)
    p[order] = np.maximum.accumulate(np.minimum(1.0, p[order] * np.arange(len(p), 0, -1)))
    return [order._replace(p=value) for order, value in zip(orders, p.tolist(), strict=True)]


def _summary(cell: Cell, trials: list[Trial]) -> Summary:
    generations = [trial.generation for trial in trials if trial.generation]
    improvements = [trial.plausible_improvement for trial in trials if trial.plausible_improvement is not None]
    ranks = [trial.rank for trial in trials if trial.rank is not None]
    return Summary(
        *cell,
        trials=len(trials),
        value=mean_interval([trial.value for trial in trials]),
        improvement=mean_interval(improvements) if len(improvements) == len(trials) else None,
        without=sum(trial.without for trial in trials),
        unimproved=sum(trial.improving == 0 for trial in trials),
        stable=sum(trial.stable for trial in trials),
        improving=sum(trial.improving for trial in trials),
        winners=sum(trial.winners for trial in trials),
        generation=sum(generations) / len(generations) if generations else None,
        falls=sum(trial.falls for trial in trials),
        refused=sum(trial.refused for trial in trials),
        rank=sum(ranks) / len(ranks) if len(ranks) == len(trials) else None,
        real_episodes=sum(trial.real_episodes for trial in trials) / len(trials),
    )
