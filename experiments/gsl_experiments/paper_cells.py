"""What the paper's tables have in common: cells, single trials, what is drawn of one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import NamedTuple

from gsl.core.interfaces import Task
from gsl.core.statistics import Interval
from gsl.core.unit import Unit
from gsl.report.markdown import table
from gsl_experiments.comparison import Summary, summaries
from gsl_experiments.comparison_table import bounds, explain_star, places
from gsl_experiments.trial import Trial


class Drawn(NamedTuple):
    """What is drawn of every trial: its values, in the unit of `axis`, and which of them failed, at what."""

    axis: str
    values: Sequence[float]
    failed: Sequence[bool] | None = None  # None: found no stable improvement
    missed: str = ""


NOTHING = ("", "", "")  # of a paper that has no such figures
SPEED = "speed [cm/s]"


def worth(trials: Sequence[Trial], task: Task) -> Drawn:
    """Return improvements where every trial has one to tell, else values."""
    improvements = [trial.plausible_improvement for trial in trials if trial.plausible_improvement is not None]
    if len(improvements) == len(trials):
        return Drawn("improvement over π0 on the real side [%]", improvements)
    return Drawn(f"on the real side [{task.unit}]", [task.shown * trial.value for trial in trials])


def improvement_cells(summary: Summary) -> tuple[str, str]:
    """Return a mean improvement and its interval [%], nothing where a trial has none to tell."""
    return ("", "") if summary.improvement is None else (f"{summary.improvement.mean:.1f}", bounds(summary.improvement))


def value_cells(interval: Interval, task: Task) -> tuple[str, str]:
    """Return a mean and its interval, in the unit that the task shows."""
    unit = Unit.of(task)
    return unit.bare(interval.mean), unit.interval([interval.lower, interval.upper])


def every_trial(trials: Sequence[Trial]) -> str:
    """Return the improvement of each single trial as a table."""
    cells = dict.fromkeys(trial.cell for trial in trials)
    rows = [
        (cell.worlds, cell.method, str(cell.iteration))
        + (", ".join(_one(trial) for trial in trials if trial.cell == cell),)
        for cell in cells
    ]
    head = f"Improvement of each trial [%]; {explain_star(trials)}:\n"
    return "\n".join([head, table(("worlds", "grounding", "iteration", "trials"), rows)])


def one_by_one(trials: Sequence[Trial], task: Task) -> str:
    """Return all that is told of each single trial as a table."""
    where = places(summaries(trials))
    tellers: dict[str, Callable[[Trial], object]] = {
        **{title: attrgetter(name) for title, name in where.items()},
        "grounding": attrgetter("method"),
        "trial": attrgetter("number"),
        f"π0 [{task.unit}]": lambda trial: f"{task.shown * trial.start:z.1f}",
        f"returned [{task.unit}]": lambda trial: f"{task.shown * trial.value:z.1f}",
        "improvement [%]": lambda trial: (
            "" if trial.plausible_improvement is None else f"{trial.plausible_improvement:z.1f}"
        ),
        f"gained at least, 95 % [{task.unit}]": lambda trial: f"{task.shown * trial.surely:.1f}",
        "best generation": lambda trial: trial.generation or "",
        "stable winners": lambda trial: f"{trial.stable} of {trial.winners}",
        "improving winners": attrgetter("improving"),
        "falls": lambda trial: f"{trial.falls} of {trial.episodes}",
        "rank": lambda trial: "" if trial.rank is None else f"{trial.rank:.2f}",
        "alpha": lambda trial: "" if trial.alpha is None else f"{trial.alpha:g}",
        "refused": lambda trial: "yes" if trial.refused else "no",
        "real episodes": attrgetter("real_episodes"),
    }
    return table(tuple(tellers), [[str(tell(trial)) for tell in tellers.values()] for trial in trials])


def _one(trial: Trial) -> str:
    improvement = trial.plausible_improvement
    return "-" if improvement is None else f"{improvement:.1f}{'*' if trial.without else ''}"
