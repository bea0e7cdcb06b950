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
from gsl_experiments.comparison_table import bounds, places, starred
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
    told = [trial.told_improvement for trial in trials if trial.told_improvement is not None]
    if len(told) == len(trials):
        return Drawn("improvement over π0 on the real side [%]", told)
    return Drawn(f"on the real side [{task.unit}]", [task.shown * trial.value for trial in trials])


def improvement_cells(one: Summary) -> tuple[str, str]:
    """Return a mean improvement and its interval [%], nothing where a trial has none to tell."""
    return ("", "") if one.improvement is None else (f"{one.improvement.mean:.1f}", bounds(one.improvement))


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
    head = f"Improvement of each trial [%]; {starred(trials)}:\n"
    return "\n".join([head, table(("worlds", "grounding", "iteration", "trials"), rows)])


def one_by_one(trials: Sequence[Trial], task: Task) -> str:
    """Return all that is told of each single trial as a table."""
    where = places(summaries(trials))
    tellers: dict[str, Callable[[Trial], object]] = {
        **{title: attrgetter(name) for title, name in where.items()},
        "grounding": attrgetter("method"),
        "trial": attrgetter("number"),
        f"π0 [{task.unit}]": lambda one: f"{task.shown * one.start:z.1f}",
        f"returned [{task.unit}]": lambda one: f"{task.shown * one.value:z.1f}",
        "improvement [%]": lambda one: "" if one.told_improvement is None else f"{one.told_improvement:z.1f}",
        f"gained at least, 95 % [{task.unit}]": lambda one: f"{task.shown * one.surely:.1f}",
        "best generation": lambda one: one.generation or "",
        "stable winners": lambda one: f"{one.stable} of {one.winners}",
        "improving winners": attrgetter("improving"),
        "falls": lambda one: f"{one.falls} of {one.episodes}",
        "rank": lambda one: "" if one.rank is None else f"{one.rank:.2f}",
        "alpha": lambda one: "" if one.alpha is None else f"{one.alpha:g}",
        "refused": lambda one: "yes" if one.refused else "no",
        "real episodes": attrgetter("real_episodes"),
    }
    return table(tuple(tellers), [[str(tell(one)) for tell in tellers.values()] for one in trials])


def _one(trial: Trial) -> str:
    told = trial.told_improvement
    return "-" if told is None else f"{told:.1f}{'*' if trial.without else ''}"
