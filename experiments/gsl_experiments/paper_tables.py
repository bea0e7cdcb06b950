"""The paper's tables 3 and 4, its linear walk and its figure 5: its figures, and ours beside them.

Figures of the paper are those of its text and tables; figure 5 has none that can be read.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from operator import attrgetter
from typing import Annotated, ClassVar

import numpy as np

from gsl.core.interfaces import Task
from gsl.core.setting import component, setting
from gsl.core.statistics import Interval, mean_interval, wilson
from gsl.report.markdown import table
from gsl.tasks.arm import Arm
from gsl_experiments.comparison import differences, summaries
from gsl_experiments.comparison_table import bounds, format_difference, places
from gsl_experiments.paper_cells import NOTHING, SPEED, Drawn, every_trial, improvement_cells, value_cells, worth
from gsl_experiments.trial import Trial

TABLE_3 = {1: ("26.3 and 26.9", "34.6 and 37.8"), 2: ("28.0", "43.3")}  # cm/s, %; SimSpark and Gazebo as simulators
TABLE_4 = {("gat", 1): ("15.7 ± 3.0", "6 of 10"), ("sgat", 1): ("16.9 ± 0.7", "0 of 10"),
           ("gat", 2): ("18.5 ± 3.6", "10 of 10"), ("sgat", 2): ("18.0 ± 2.2", "1 of 10")}  # fmt: skip
LINEAR_WALK = {"none": ("1.3", "2 of 5", "1"), "gat": ("4.95", "0 of 5", "3")}
AT_THE_END, ON_AVERAGE, ABOVE = "distance [deg]", "mean distance [deg]", "above [share]"  # of the arms


@component
class Table3:
    """Speed after each iteration, with either simulator; all are run, and told is what an `iterate` would return.

    With `accept=true` it stops after an iteration whose gain is not sure, and returns the policy before it, or the
    first if it gained; without, it ends at a grounding that is refused. Where it stops is decided by the very episodes
    that are told, which flatters it a little where intervals are wide.
    """

    def markdown(self, trials: Sequence[Trial], task: Task) -> str:
        """Return the table."""
        results = summaries(trials)
        where = places(results, shown=["iteration"])
        titles = (
            *(*where, "grounding", "iteration", f"on the real side [{task.unit}]", "95 % interval", "improvement [%]"),
            *("95 % interval", "best generation", "falls", "refused", "stopped by then"),
            *(f"where they stop [{task.unit}]", "real episodes", f"paper [{task.unit}]", "paper: improvement [%]"),
        )
        rows = []
        for row in results:
            own = row.own(trials)
            chains = [[past for past in trials if past.cell[:3] == row[:3] and past.number == k.number] for k in own]
            so_far = [[past for past in chain if past.iteration <= row.iteration] for chain in chains]
            stops = sum(any(past.surely <= 0.0 for past in chain) for chain in so_far)
            stopped = mean_interval([_read_return(chain) for chain in so_far])
            paper = TABLE_3.get(row.iteration, NOTHING[:2]) if row.method == "gat" else NOTHING[:2]
            rows.append(
                (*row.cells(where), row.method, str(row.iteration))
                + (*value_cells(row.value, task), *improvement_cells(row))
                + (
                    row.best_generation,
                    str(row.falls),
                    f"{row.refused} of {row.trials}",
                    f"{stops} of {row.trials}",
                    value_cells(stopped, task)[0],
                    f"{row.real_episodes:.0f}",
                    *paper,
                )
            )
        start = mean_interval([trial.start for trial in trials if trial.iteration == 1])
        below = f"π0 on the real side: {task.shown * start.mean:.1f} {task.unit} (paper: 19.5)."
        return "\n".join([table(titles, rows), below, "", every_trial(trials)])

    def select(self, trials: Sequence[Trial], task: Task) -> Drawn:
        """Return what a trial is worth."""
        return worth(trials, task)


@component
class Table4:
    """Speed and falls on uneven ground after each grounding step."""

    against: Annotated[tuple[str, ...], setting("methods that the others are set against")] = ("none", "gat", "sgat")

    def markdown(self, trials: Sequence[Trial], task: Task) -> str:
        """Return the table."""
        results = summaries(trials)
        where = places(results, shown=["iteration"])
        titles = (
            *(*where, "grounding", "step", f"on the real side, a fall worth 0 [{task.unit}]", "95 % interval"),
            *("speed [cm/s]", "falls", "95 % interval [%]", "real episodes", "paper: speed [cm/s]", "paper: falls"),
        )
        rows = []
        for row in results:
            own = row.own(trials)
            low, high = (f"{100 * bound:.0f}" for bound in _share_of_falls(own)[1:])
            speed = np.mean([trial.outcome.get(SPEED, np.nan) for trial in own])
            rows.append(
                (*row.cells(where), row.method, str(row.iteration))
                + (*value_cells(row.value, task), f"{speed:.1f}")
                + (f"{row.falls} of {sum(trial.episodes for trial in own)}", f"{low} to {high}")
                + (f"{row.real_episodes:.0f}", *TABLE_4.get((row.method, row.iteration), NOTHING[:2]))
            )
        start = mean_interval([trial.start for trial in trials if trial.iteration == 1])
        below = [
            f"π0 on the real side, a fall worth 0: {task.shown * start.mean:.1f} {task.unit} "
            "(paper: 14.7, always falls).",
            "Speed is distance over the planned time, falls and all; intervals are over trials.\n",
        ]
        return "\n".join([table(titles, rows), *below, *_differences(trials, task, self.against, falls=True)])

    def select(self, trials: Sequence[Trial], task: Task) -> Drawn:
        """Return what a trial is worth: of a π0 that falls half of the time shares would be of little."""
        return Drawn(f"on the real side, a fall worth 0 [{task.unit}]", [task.shown * trial.value for trial in trials])


@component
class LinearWalkTable:
    """Distance in real, and how many trials do not improve, as in table 2; the paper's walk has one iteration."""

    def markdown(self, trials: Sequence[Trial], task: Task) -> str:
        """Return the table."""
        results = summaries(trials)
        where = places(results, shown=["iteration"])
        titles = (
            *(*where, "grounding", "iteration", f"distance on the real side [{task.unit}]", "95 % interval"),
            *("trials without a gain", "without an improving winner", "best generation", "falls", "real episodes"),
            *("paper [cm]", "paper: without an improving winner", "paper: best generation"),
        )
        rows = [
            (*row.cells(where), row.method, str(row.iteration), *value_cells(row.value, task))
            + (f"{row.without} of {row.trials}", f"{row.unimproved} of {row.trials}", row.best_generation)
            + (str(row.falls),)
            + (f"{row.real_episodes:.0f}", *(LINEAR_WALK.get(row.method, NOTHING) if row.iteration == 1 else NOTHING))
            for row in results
        ]
        return "\n".join([table(titles, rows), *_differences(trials, task, ("none", "gat"))])

    def select(self, trials: Sequence[Trial], task: Task) -> Drawn:
        """Return the distances."""
        return Drawn(f"distance on the real side [{task.unit}]", [task.shown * trial.value for trial in trials])


@component
class Figure5:
    """Distance of the arms to their goal with the last generation's policy, which nothing real has chosen.

    Beside it that of the policy which the real world chose among the best of all generations.
    """

    of: ClassVar[type] = Arm

    def markdown(self, trials: Sequence[Trial], task: Task) -> str:
        """Return the figure's values as a table."""
        rows, first, results = [], trials[0].method, summaries(trials)
        where = places(results)
        for row in results:
            own = row.own(trials)
            farther = differences(trials, own[0].cell, first, _on_average)
            cells = (
                *_degrees(map(_on_average, own)),
                "" if row.method == first else format_difference(farther),
                *_degrees(trial.last[AT_THE_END] for trial in own),
                f"{sum(trial.last[ABOVE] > 0.0 for trial in own)} of {len(own)}",
                *_degrees(trial.outcome[ON_AVERAGE] for trial in own),
                f"{row.real_episodes:.0f}",
            )
            rows.append((*row.cells(where), row.method, *cells))
        titles = (
            *(*where, "grounding", "mean distance [°]", "95 % interval", f"minus {first} [°] (95 %)"),
            *("final distance [°]", "95 % interval", "trials above the goal"),
            *("chosen on the real side: mean distance [°]", "95 % interval", "real episodes"),
        )
        return table(titles, rows)

    def select(self, trials: Sequence[Trial], task: Task) -> Drawn:
        """Return the mean distances; an arm above the goal has failed."""
        failed = [trial.last[ABOVE] > 0.0 for trial in trials]
        return Drawn(
            "mean distance on the real side [°], less is better",
            list(map(_on_average, trials)),
            failed,
            "above the goal",
        )


def _differences(trials: Sequence[Trial], task: Task, against: Sequence[str], *, falls: bool = False) -> list[str]:
    """Return the table of values, and of falls, against those of other methods, paired by trial, if there are any."""
    methods, rows = list(dict.fromkeys(trial.method for trial in trials)), []
    where = places(summaries(trials), shown=["iteration"])
    for other, cell in product(against, dict.fromkeys(trial.cell for trial in trials)):
        if other not in methods or methods.index(cell.method) <= methods.index(other):
            continue
        apart = value_cells(differences(trials, cell, other, attrgetter("value")), task)
        fewer = differences(trials, cell, other, attrgetter("falls"))
        counted = (f"{fewer.mean:+.1f}", bounds(fewer, sign=True)) if falls else ()
        places_of = (getattr(cell, name) for name in where.values())
        rows.append((*places_of, f"{cell.method} - {other}", str(cell.iteration), *apart, *counted))
    counted = ("falls of a trial", "95 % interval") if falls else ()
    titles = ("difference", "iteration", f"on the real side [{task.unit}]", "95 % interval, paired by trial")
    return [table((*where, *titles, *counted), rows)] if rows else []


def _on_average(trial: Trial) -> float:
    return trial.last[ON_AVERAGE]


def _degrees(distances: Iterable[float]) -> tuple[str, str]:
    """Return the cells of a mean and its interval."""
    interval = mean_interval(list(distances))
    return f"{interval.mean:.1f}", bounds(interval)


def _share_of_falls(trials: Sequence[Trial]) -> Interval:
    """Return the share of falls with an interval over trials; over episodes where all trials are alike."""
    shares = [trial.falls / trial.episodes for trial in trials]
    if np.ptp(shares) == 0.0:
        return wilson(sum(trial.falls for trial in trials), sum(trial.episodes for trial in trials))
    return Interval(*np.clip(mean_interval(shares), 0.0, 1.0).tolist())


def _read_return(chain: Sequence[Trial]) -> float:
    """Return the value of what an `iterate` of a trial's iterations, in order, returns."""
    value = chain[0].start
    for trial in chain:
        sure = trial.surely > 0.0
        if sure or (trial.iteration == 1 and trial.value > trial.start):
            value = trial.value
        if not sure:
            break
    return value
