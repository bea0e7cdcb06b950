"""The paper's table 2, groundings on the walk: its figures, and ours beside them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from gsl.core.interfaces import Task
from gsl.core.setting import component, setting
from gsl.report.markdown import table
from gsl_experiments.comparison import Summary, differences, orders, summaries
from gsl_experiments.comparison_table import format_difference, places
from gsl_experiments.paper_cells import NOTHING, SPEED, Drawn, every_trial, improvement_cells, worth
from gsl_experiments.trial import Cell, Trial

TABLE_2 = {"none": ("11.1", "7 of 10", "1.3"), "ane": ("18.9", "5 of 10", "6.6"), "gat": ("22.5", "1 of 10", "2.7")}
LEAST = 0.001  # probability that is told


@component
class Table2:
    """Improvement over π0 in real, trials without a stable improvement, best generation; and what we add to it.

    Winners of generations are measured in the episodes of the choice, up to their first fall: a winner is stable if it
    fell in none, and improving if it was faster than π0 besides. A trial without an improving winner is what the paper
    counts as a failure; in one without a gain the returned policy falls in fresh episodes, or is not surely better.

    Action noise is told for every width; the best of them by real figures is an oracle, which knows what no user knows
    beforehand.
    """

    width: Annotated[str, setting("action noise whose width was chosen beforehand")] = "ane_02"
    tested: Annotated[tuple[str, ...], setting("methods whose order is tested")] = ("gat", "sgat")
    against: Annotated[tuple[str, ...], setting("methods that they are tested against")] = ("none", "ane_02")
    beside: Annotated[tuple[str, ...], setting("methods that improvements are set against")] = ("none", "ane_02")

    def markdown(self, trials: Sequence[Trial], task: Task) -> str:
        """Return the table, differences paired by trial, the test of the order, and the single trials."""
        results = summaries(trials)
        where, there = places(results), places(results, shown=["iteration"])
        titles = (
            *(*where, "grounding", "improvement [%]", "95 % interval", "trials without a gain"),
            *("without an improving winner", "best generation", "stable winners", "improving winners"),
            "last generation's improves",
            *(f"π0 and returned [{task.unit}]", "falls", "refused", "rank"),
            *("real episodes", "paper: improvement [%]", "paper: without an improving winner"),
            "paper: best generation",
        )
        rows = [
            (*row.cells(where), self._name(row, results))
            + (*improvement_cells(row), f"{row.without} of {row.trials}")
            + (f"{row.unimproved} of {row.trials}", row.best_generation)
            + (f"{row.stable} of {row.winners}", f"{row.improving} of {row.winners}", _last(trials, row, task))
            + (_speeds(trials, row, task), str(row.falls), f"{row.refused} of {row.trials}")
            + ("" if row.rank is None else f"{row.rank:.2f}", f"{row.real_episodes:.0f}")
            + self._paper(row)
            for row in results
        ]
        parts = [table(titles, rows)]
        apart = [[_apart(trials, row, other) for other in self.beside] for row in results]
        if any(map(any, apart)):
            parts.append("Improvement against others, paired by trial [percentage points] (95 %, each for itself):\n")
            beside = (*where, "grounding", *(f"than {other}" for other in self.beside))
            rows = [(*row.cells(where), row.method, *cells) for row, cells in zip(results, apart, strict=True)]
            parts.append(table(beside, rows))
        tested = [
            (*row.cells(there), f"{order.method} - {order.other}", f"{order.difference:+.1f}", _probability(order.p))
            for row in {(row.simulator, row.world): row for row in results}.values()
            for order in orders(trials, row.simulator, row.world, self.tested, self.against)
        ]
        if tested:
            parts.append("Order of methods by their stable winners, Wilcoxon's signed rank over trials:\n")
            parts.append(table((*there, "difference", "stable winners a trial", "p, Holm-corrected"), tested))
        return "\n".join([*parts, every_trial(trials)])

    def _name(self, row: Summary, results: Sequence[Summary]) -> str:
        """Return the name of a method, of a width of action noise with how it was chosen."""
        noisy = [other for other in results if other.method.startswith("ane") and other.improvement is not None]
        noisy = [other for other in noisy if other[:2] == row[:2] and other.iteration == row.iteration]
        said = ["chosen beforehand"] if row.method == self.width else []
        if len(noisy) > 1 and row is max(noisy, key=lambda other: other.improvement.mean if other.improvement else 0.0):
            said.append("oracle: best by real")
        return f"{row.method} ({'; '.join(said)})" if said else row.method

    def _paper(self, row: Summary) -> tuple[str, ...]:
        method = "ane" if row.method == self.width else row.method
        return TABLE_2.get(method, NOTHING) if row.iteration == 1 else NOTHING

    def select(self, trials: Sequence[Trial], task: Task) -> Drawn:
        """Return what a trial is worth."""
        return worth(trials, task)


def _apart(trials: Sequence[Trial], row: Summary, other: str) -> str:
    """Return by how much a method's improvement is above another's, nothing where there is none to be set against."""
    cell = Cell(*row[:4])
    pair = [trial for trial in trials if trial.cell in (cell, cell._replace(method=other))]
    tried = {trial.method for trial in pair}
    if row.method == other or other not in tried or any(trial.plausible_improvement is None for trial in pair):
        return ""
    return format_difference(differences(trials, cell, other))


def _last(trials: Sequence[Trial], row: Summary, task: Task) -> str:
    """Return in how many trials the last generation's best, which nothing real has chosen, is stable and faster."""
    own = row.own(trials)
    if not all(SPEED in trial.last and trial.last_falls is not None for trial in own):
        return ""
    better = (trial.last_falls == 0 and trial.last[SPEED] > task.shown * trial.start for trial in own)
    return f"{sum(better)} of {len(own)}"


def _probability(p: float) -> str:
    return f"{p:.3f}" if p >= LEAST else f"<{LEAST:g}"


def _speeds(trials: Sequence[Trial], row: Summary, task: Task) -> str:
    own = row.own(trials)
    start, after = (task.shown * float(np.mean([getattr(trial, name) for trial in own])) for name in ("start", "value"))
    return f"{start:.1f}, {after:.1f}"
