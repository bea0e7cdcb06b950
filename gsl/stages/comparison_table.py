"""The tables of a comparison."""

from __future__ import annotations

from collections.abc import Sequence

from gsl.core.statistics import Interval
from gsl.report.markdown import table
from gsl.stages.comparison import Summary, differences
from gsl.stages.trial import Cell, Trial

COLUMNS = (
    *("real world", "grounding", "improvement in real [%]", "95 % interval", "trials without"),
    *("stable winners", "improving winners", "best generation", "falls in fresh episodes", "refused by the check"),
    *("rank correlation", "real episodes"),
)


def rows(found: Sequence[Summary]) -> list[tuple[str, ...]]:
    """Return the table's cells; its titles are `COLUMNS`."""
    return [
        (
            one.world,
            one.method,
            "" if one.improvement is None else f"{one.improvement.mean:.1f}",
            "" if one.improvement is None else told(one.improvement),
            f"{one.without} of {one.trials}",
            f"{one.stable} of {one.winners}",
            f"{one.improving} of {one.winners}",
            f"{one.generation:.1f}",
            f"{one.falls}",
            f"{one.refused} of {one.trials}",
            "" if one.rank is None else f"{one.rank.mean:.2f}",
            f"{one.real_episodes:.0f}",
        )
        for one in found
    ]


def markdown(found: Sequence[Summary], trials: Sequence[Trial]) -> str:
    """Return the table, the paired differences to the first method, and the improvement of every single trial."""
    first, single, paired = found[0].method, [], []
    for one in found:
        values = [
            f"{trial.improvement:.1f}{'*' if trial.without else ''}"
            for trial in trials
            if trial.cell == one[:4] and trial.improvement is not None
        ]
        single.append((one.world, one.method, ", ".join(values)))
        if one.method != first and one.improvement is not None:
            difference = differences(trials, Cell(*one[:4]), first)
            paired.append((one.world, f"{one.method} - {first}", f"{difference.mean:+.1f}", told(difference)))
    return "\n".join(
        [
            table(COLUMNS, rows(found)),
            "Differences of the improvement, paired by trial [percentage points]:\n",
            table(("real world", "difference", "mean", "95 % interval"), paired),
            "Improvement of each trial [%], in the order of the trials; * without a stable improvement:\n",
            table(("real world", "grounding", "trials"), single),
        ]
    )


def told(interval: Interval) -> str:
    """Return the bounds of an interval for people."""
    return f"{interval.lower:.1f} to {interval.upper:.1f}"
