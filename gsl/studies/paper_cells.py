"""What the paper's tables have in common: cells, single trials, what is drawn of one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gsl.core.statistics import Interval
from gsl.report.markdown import table
from gsl.stages.headline import Unit
from gsl.studies.comparison import Summary
from gsl.studies.comparison_table import starred, told
from gsl.studies.trial import Trial
from gsl.tasks.task import Task


class Drawn(NamedTuple):
    """What is drawn of every trial: its values, in the unit of `axis`, and which of them failed, at what."""

    axis: str
    values: Sequence[float]
    failed: Sequence[bool] | None = None  # None: found no stable improvement
    missed: str = ""


NOTHING = ("", "", "")  # of a paper that has no such figures
SPEED = "speed [cm/s]"


def worth(trials: Sequence[Trial], task: Task) -> Drawn:
    """Return improvements where π0 is worth something in every trial, else values."""
    improvements = [trial.improvement for trial in trials if trial.improvement is not None]
    if len(improvements) == len(trials):
        return Drawn("improvement over π0 in real [%]", improvements)
    return Drawn(f"in real [{task.unit}]", [task.shown * trial.value for trial in trials])


def improvement_cells(one: Summary) -> tuple[str, str]:
    """Return a mean improvement and its interval [%], nothing where π0 is worth nothing."""
    return ("", "") if one.improvement is None else (f"{one.improvement.mean:.1f}", told(one.improvement))


def value_cells(interval: Interval, task: Task) -> tuple[str, str]:
    """Return a mean and its interval, in the unit that the task shows."""
    unit = Unit.of(task)
    return unit.bare(interval.mean), unit.interval([interval.lower, interval.upper])


def every_trial(trials: Sequence[Trial]) -> str:
    """Return the improvement of each single trial as a table."""
    cells = dict.fromkeys(trial.cell for trial in trials)
    rows = [
        (" ".join(filter(None, (cell.simulator, cell.world))), cell.method, str(cell.iteration))
        + (", ".join(_one(trial) for trial in trials if trial.cell == cell),)
        for cell in cells
    ]
    head = f"Improvement of each trial [%]; {starred(trials)}:\n"
    return "\n".join([head, table(("worlds", "grounding", "iteration", "trials"), rows)])


def _one(trial: Trial) -> str:
    return "-" if trial.improvement is None else f"{trial.improvement:.1f}{'*' if trial.without else ''}"
