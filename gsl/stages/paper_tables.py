"""The paper's tables 2, 3 and 4, its linear walk and its figure 5: its figures, and ours beside them.

Figures of the paper are those of its text and tables; figure 5 has none that can be read.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Annotated

import numpy as np

from gsl.core.setting import component, setting
from gsl.core.statistics import Interval, mean_interval, wilson
from gsl.report.markdown import table
from gsl.stages.comparison import Summary, differences, orders, summaries
from gsl.stages.comparison_table import told
from gsl.stages.trial import Cell, Trial
from gsl.tasks.task import Task

TABLE_2 = {"none": ("11.1", "7 of 10", "1.3"), "ane": ("18.9", "5 of 10", "6.6"), "gat": ("22.5", "1 of 10", "2.7")}
TABLE_3 = {1: ("26.3 and 26.9", "34.6 and 37.8"), 2: ("28.0", "43.3")}  # cm/s, %; SimSpark and Gazebo as simulators
TABLE_4 = {("gat", 1): ("15.7 ± 3.0", "6 of 10"), ("sgat", 1): ("16.9 ± 0.7", "0 of 10"),
           ("gat", 2): ("18.5 ± 3.6", "10 of 10"), ("sgat", 2): ("18.0 ± 2.2", "1 of 10")}  # fmt: skip
LINEAR_WALK = {"none": ("1.3", "3 of 5", "1"), "gat": ("4.95", "5 of 5", "3")}
NOTHING = ("", "", "")
SPEED = "speed [cm/s]"


AT_THE_END, ON_AVERAGE = "distance [deg]", "mean distance [deg]"  # of the arms


@component
class Table2:
    """Improvement over π0 in real, trials without a stable improvement, best generation; and what we add to it.

    Action noise is told for every width; the best of them by real figures knows what no user knows beforehand.
    """

    tested: Annotated[tuple[str, ...], setting("methods whose order is tested")] = ("gat", "sgat")
    against: Annotated[tuple[str, ...], setting("methods that they are tested against")] = ("none", "ane_02")

    def markdown(self, trials: Sequence[Trial], task: Task) -> str:
        """Return the table, differences paired by trial, the test of the order, and the single trials."""
        found = summaries(trials)
        oracles = {_best_noise(found, world) for world in dict.fromkeys(one.world for one in found)}
        titles = (
            *("real world", "grounding", "improvement [%]", "95 % interval", "trials without a gain"),
            *("best generation", "stable winners", f"π0 and returned [{task.unit}]", "falls", "refused", "rank"),
            *("real episodes", "paper: improvement [%]", "paper: without", "paper: best generation"),
        )
        rows = [
            (one.world, one.method + (" (best by real)" if (one.world, one.method) in oracles else ""))
            + (*_improvement(one), f"{one.without} of {one.trials}", f"{one.generation:.1f}")
            + (f"{one.stable} of {one.winners}", _speeds(trials, one, task), str(one.falls))
            + (f"{one.refused} of {one.trials}",)
            + ("" if one.rank is None else f"{one.rank.mean:.2f}", f"{one.real_episodes:.0f}")
            + TABLE_2.get("ane" if one.method == "ane_02" else one.method, NOTHING)
            for one in found
        ]
        parts = [table(titles, rows)]
        apart = [(one.world, one.method, *(_apart(trials, one, other) for other in self.against)) for one in found]
        if any(any(cells) for _, _, *cells in apart):
            parts.append("Improvement against others, paired by trial [percentage points] (95 %, each for itself):\n")
            parts.append(table(("real world", "grounding", *(f"than {other}" for other in self.against)), apart))
        tested = [
            (world, f"{order.method} - {order.other}", f"{order.difference:+.1f}", f"{order.p:.3f}")
            for world in dict.fromkeys(one.world for one in found)
            for order in orders(trials, found[0].simulator, world, self.tested, self.against)
        ]
        if tested:
            parts.append("Order of methods by their stable winners, Wilcoxon's signed rank over trials:\n")
            parts.append(table(("real world", "difference", "stable winners a trial", "p, Holm-corrected"), tested))
        return "\n".join([*parts, _single(trials)])

    def drawn(self, trials: Sequence[Trial], task: Task) -> tuple[str, list[float]]:
        """Return what a trial is worth."""
        return worth(trials, task)


@component
class Table3:
    """Speed after each iteration, with either simulator; all are run, and told is what an `iterate` would return.

    That stops after an iteration whose gain is not sure, and returns the policy before it, or the first if it gained.
    """

    def markdown(self, trials: Sequence[Trial], task: Task) -> str:
        """Return the table."""
        titles = (
            *("simulator", "grounding", "iteration", f"in real [{task.unit}]", "95 % interval", "improvement [%]"),
            *("95 % interval", "falls", "stopped by then", f"where they stop [{task.unit}]", "real episodes"),
            *(f"paper [{task.unit}]", "paper: improvement [%]"),
        )
        rows = []
        for one in summaries(trials):
            own = [trial for trial in trials if trial.cell == one[:4]]
            chains = [[past for past in trials if past.cell[:3] == one[:3] and past.number == k.number] for k in own]
            so_far = [[past for past in chain if past.iteration <= one.iteration] for chain in chains]
            stops = sum(any(past.surely <= 0.0 for past in chain) for chain in so_far)
            stopped = mean_interval([_returned(chain) for chain in so_far])
            paper = TABLE_3.get(one.iteration, NOTHING[:2]) if one.method == "gat" else NOTHING[:2]
            rows.append(
                (one.simulator, one.method, str(one.iteration), *_value(one.value, task), *_improvement(one))
                + (
                    str(one.falls),
                    f"{stops} of {one.trials}",
                    _value(stopped, task)[0],
                    f"{one.real_episodes:.0f}",
                    *paper,
                )
            )
        start = mean_interval([trial.start for trial in trials if trial.iteration == 1])
        below = f"π0 in real: {task.shown * start.mean:.1f} {task.unit} (paper: 19.5)."
        return "\n".join([table(titles, rows), below, "", _single(trials)])

    def drawn(self, trials: Sequence[Trial], task: Task) -> tuple[str, list[float]]:
        """Return what a trial is worth."""
        return worth(trials, task)


@component
class Table4:
    """Speed and falls on uneven ground after each grounding step."""

    against: Annotated[tuple[str, ...], setting("methods that the others are set against")] = ("none", "gat", "sgat")

    def markdown(self, trials: Sequence[Trial], task: Task) -> str:
        """Return the table."""
        titles = (
            *("grounding", "step", f"in real, a fall worth 0 [{task.unit}]", "95 % interval", "speed [cm/s]", "falls"),
            *("95 % interval [%]", "real episodes", "paper: speed [cm/s]", "paper: falls"),
        )
        rows = []
        for one in summaries(trials):
            own = [trial for trial in trials if trial.cell == one[:4]]
            low, high = (f"{100 * bound:.0f}" for bound in _share_of_falls(own)[1:])
            speed = np.mean([trial.outcome.get(SPEED, np.nan) for trial in own])
            rows.append(
                (one.method, str(one.iteration), *_value(one.value, task), f"{speed:.1f}")
                + (f"{one.falls} of {sum(trial.episodes for trial in own)}", f"{low} to {high}")
                + (f"{one.real_episodes:.0f}", *TABLE_4.get((one.method, one.iteration), NOTHING[:2]))
            )
        start = mean_interval([trial.start for trial in trials if trial.iteration == 1])
        below = [
            f"π0 in real, a fall worth 0: {task.shown * start.mean:.1f} {task.unit} (paper: 14.7, always falls).",
            "Speed is distance over the planned time, falls and all; intervals are over trials.\n",
        ]
        return "\n".join([table(titles, rows), *below, _differences(trials, task, self.against, falls=True)])

    def drawn(self, trials: Sequence[Trial], task: Task) -> tuple[str, list[float]]:
        """Return what a trial is worth: of a π0 that falls half of the time shares would be of little."""
        return f"in real, a fall worth 0 [{task.unit}]", [task.shown * trial.value for trial in trials]


@component
class LinearWalkTable:
    """Distance in real, and how many trials improve at all; the paper's walk has one iteration."""

    def markdown(self, trials: Sequence[Trial], task: Task) -> str:
        """Return the table."""
        titles = (
            *(
                "real world",
                "grounding",
                "iteration",
                f"distance in real [{task.unit}]",
                "95 % interval",
                "trials that improve",
            ),
            *("best generation", "falls", "real episodes", "paper [cm]", "paper: improve", "paper: best generation"),
        )
        rows = [
            (one.world, one.method, str(one.iteration), *_value(one.value, task))
            + (f"{one.trials - one.without} of {one.trials}", f"{one.generation:.1f}", str(one.falls))
            + (f"{one.real_episodes:.0f}", *(LINEAR_WALK.get(one.method, NOTHING) if one.iteration == 1 else NOTHING))
            for one in summaries(trials)
        ]
        return "\n".join([table(titles, rows), _differences(trials, task, ("none", "gat"))])

    def drawn(self, trials: Sequence[Trial], task: Task) -> tuple[str, list[float]]:
        """Return the distances."""
        return f"distance in real [{task.unit}]", [task.shown * trial.value for trial in trials]


@component
class Figure5:
    """Distance of the arms to their goal with the last generation's policy, which nothing real has chosen."""

    def markdown(self, trials: Sequence[Trial], task: Task) -> str:
        """Return the figure's values as a table."""
        rows = []
        for one in summaries(trials):
            own = [trial.last for trial in trials if trial.cell == one[:4]]
            on_average, at_the_end = (mean_interval([last[name] for last in own]) for name in (ON_AVERAGE, AT_THE_END))
            cells = [cell for found in (on_average, at_the_end) for cell in (f"{found.mean:.2f}", told(found))]
            above = sum(last["above [share]"] > 0.0 for last in own)
            rows.append((one.world, one.method, *cells, f"{above} of {len(own)}"))
        titles = ("mean distance [°]", "95 % interval", "final distance [°]", "95 % interval", "trials above the goal")
        return table(("real world", "grounding", *titles), rows)

    def drawn(self, trials: Sequence[Trial], task: Task) -> tuple[str, list[float]]:
        """Return the mean distances."""
        return "mean distance in real [°]", [trial.last[ON_AVERAGE] for trial in trials]


def _differences(trials: Sequence[Trial], task: Task, against: Sequence[str], *, falls: bool = False) -> str:
    """Return the table of values, and of falls, against those of other methods, paired by trial."""
    methods, rows = list(dict.fromkeys(trial.method for trial in trials)), []
    for other, cell in product(against, dict.fromkeys(trial.cell for trial in trials)):
        if other not in methods or methods.index(cell.method) <= methods.index(other):
            continue
        apart = _value(differences(trials, cell, other, "value"), task)
        fewer = differences(trials, cell, other, "falls")
        counted = (f"{fewer.mean:+.1f}", f"{fewer.lower:+.1f} to {fewer.upper:+.1f}") if falls else ()
        rows.append((cell.world, f"{cell.method} - {other}", str(cell.iteration), *apart, *counted))
    counted = ("falls of a trial", "95 % interval") if falls else ()
    titles = ("real world", "difference", "iteration", f"in real [{task.unit}]", "95 % interval, paired by trial")
    return table((*titles, *counted), rows)


def _apart(trials: Sequence[Trial], one: Summary, other: str) -> str:
    """Return by how much a method's improvement is above another's, nothing where there is none to be set against."""
    cell = Cell(*one[:4])
    pair = [trial for trial in trials if trial.cell in (cell, cell._replace(method=other))]
    tried = {trial.method for trial in pair}
    if one.method == other or other not in tried or any(trial.improvement is None for trial in pair):
        return ""
    found = differences(trials, cell, other)
    return f"{found.mean:+.1f} ({told(found)})"


def _share_of_falls(trials: Sequence[Trial]) -> Interval:
    """Return the share of falls with an interval over trials; over episodes where all trials are alike."""
    shares = [trial.falls / trial.episodes for trial in trials]
    if np.ptp(shares) == 0.0:
        return wilson(sum(trial.falls for trial in trials), sum(trial.episodes for trial in trials))
    return Interval(*np.clip(mean_interval(shares), 0.0, 1.0).tolist())


def _returned(chain: Sequence[Trial]) -> float:
    """Return the value of what an `iterate` of a trial's iterations, in order, returns."""
    value = chain[0].start
    for trial in chain:
        sure = trial.surely > 0.0
        if sure or (trial.iteration == 1 and trial.value > trial.start):
            value = trial.value
        if not sure:
            break
    return value


def worth(trials: Sequence[Trial], task: Task) -> tuple[str, list[float]]:
    """Return improvements where π0 is worth something in every trial, else values."""
    improvements = [trial.improvement for trial in trials if trial.improvement is not None]
    if len(improvements) == len(trials):
        return "improvement over π0 in real [%]", improvements
    return f"in real [{task.unit}]", [task.shown * trial.value for trial in trials]


def _best_noise(found: Sequence[Summary], world: str) -> tuple[str, str]:
    noisy = [one for one in found if one.world == world and one.method.startswith("ane") and one.improvement]
    if len(noisy) < 2:
        return world, ""  # nothing was chosen
    return world, max(noisy, key=lambda one: one.improvement.mean if one.improvement else 0.0).method


def _improvement(one: Summary) -> tuple[str, str]:
    return ("", "") if one.improvement is None else (f"{one.improvement.mean:.1f}", told(one.improvement))


def _value(interval: Interval, task: Task) -> tuple[str, str]:
    mean, low, high = (task.shown * value for value in interval)
    return f"{mean:.1f}", f"{low:.1f} to {high:.1f}"


def _speeds(trials: Sequence[Trial], one: Summary, task: Task) -> str:
    own = [trial for trial in trials if trial.cell == one[:4]]
    start, after = (task.shown * float(np.mean([getattr(trial, name) for trial in own])) for name in ("start", "value"))
    return f"{start:.1f}, {after:.1f}"


def _single(trials: Sequence[Trial]) -> str:
    cells = dict.fromkeys(trial.cell for trial in trials)
    rows = [
        (" ".join(filter(None, (cell.simulator, cell.world))), cell.method, str(cell.iteration))
        + (", ".join(_one(trial) for trial in trials if trial.cell == cell),)
        for cell in cells
    ]
    head = "Improvement of each trial [%]; * without a stable improvement:\n"
    return "\n".join([head, table(("worlds", "grounding", "iteration", "trials"), rows)])


def _one(trial: Trial) -> str:
    return "-" if trial.improvement is None else f"{trial.improvement:.1f}{'*' if trial.without else ''}"
