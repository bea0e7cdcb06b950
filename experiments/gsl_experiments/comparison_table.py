"""The tables of a comparison."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter

from gsl.core.statistics import Interval
from gsl.core.unit import Unit
from gsl.core.words import in_unit
from gsl.report.markdown import table
from gsl_experiments.comparison import Summary, differences
from gsl_experiments.trial import Cell, Trial

SHARE = Unit(name="%")
BY_FALLS = ("stable winners", "falls in fresh episodes")


def markdown(results: Sequence[Summary], trials: Sequence[Trial], unit: Unit) -> str:
    """Return the table, the paired differences to the first method, and every single trial.

    Trials are told as improvements where each of them has one to tell, else as what they are worth.
    """
    first, columns, titles = results[0].method, _columns(results, unit), places(results)
    as_shares = all(trial.plausible_improvement is not None for trial in trials)
    figure, name = ("plausible_improvement", "improvement") if as_shares else ("value", "value")
    own = SHARE if as_shares else unit
    shown = in_unit(f"{name} on the real side", own.name)

    single, paired = [], []
    for summary in results:
        values = [own.bare(getattr(trial, figure)) + "*" * trial.without for trial in summary.own(trials)]
        where = summary.cells(titles)
        single.append((*where, summary.method, ", ".join(values)))
        if summary.method != first:
            apart = differences(trials, Cell(*summary[:4]), first, attrgetter(figure))
            cells = (own.bare(apart.mean, sign=True), own.interval([apart.lower, apart.upper]))
            paired.append((*where, f"{summary.method} - {first}", *cells))
    parts = [table(tuple(columns), list(zip(*columns.values(), strict=True)))]
    if paired:
        parts.append(f"Differences of the {shown}, paired by trial{' (percentage points)' * as_shares}:\n")
        parts.append(table((*titles, "difference", "mean", "95 % interval"), paired))
    parts.append(f"The {shown} of each trial, in their order; {explain_star(trials)}:\n")
    return "\n".join([*parts, table((*titles, "grounding", "trials"), single)])


def bounds(interval: Interval, *, sign: bool = False) -> str:
    """Return the bounds of an interval for people."""
    return SHARE.interval([interval.lower, interval.upper], sign=sign)


def finely(interval: Interval) -> str:
    """Return the bounds of an interval of degrees for people; a single value has none."""
    return "-" if math.isinf(interval.lower) else f"{interval.lower:.2f} to {interval.upper:.2f}"


def format_difference(difference: Interval, *, fine: bool = False) -> str:
    """Return a difference and its bounds for people; `fine` of degrees."""
    mean = difference.mean
    return f"{mean:+.2f} ({finely(difference)})" if fine else f"{mean:+.1f} ({bounds(difference)})"


def explain_star(trials: Sequence[Trial]) -> str:
    """Return what a star behind a trial's figure says: of several iterations it is of that one alone."""
    then = " by that iteration" if any(trial.iteration > 1 for trial in trials) else ""
    return f"* without a stable improvement{then}"


def places(results: Sequence[Summary], shown: Sequence[str] = ()) -> dict[str, str]:
    """Return by title the fields that tell where trials were, but for those that a table has `shown` already.

    Simulator and iteration are among them only where there are several.
    """
    titles = {"simulator": "simulator", "real world": "world", "iteration": "iteration"}
    several = {name for name in titles.values() if len({getattr(summary, name) for summary in results}) > 1}
    return {title: name for title, name in titles.items() if name in {*several, "world"} - {*shown}}


def _columns(results: Sequence[Summary], unit: Unit) -> Mapping[str, Sequence[str]]:
    """Return the cells below each title, but for columns that have none: without falls there are no stable winners."""
    tellers: dict[str, Callable[[Summary], object]] = {
        **{title: attrgetter(name) for title, name in places(results).items()},
        "grounding": lambda row: row.method,
        f"{in_unit('on the real side', unit.name)} (95 %)": lambda row: (
            f"{unit.bare(row.value.mean)} ({unit.interval([row.value.lower, row.value.upper])})"
        ),
        "improvement on the real side [%] (95 %)": lambda row: (
            "" if row.improvement is None else f"{row.improvement.mean:.1f} ({bounds(row.improvement)})"
        ),
        "trials without a gain": lambda row: f"{row.without} of {row.trials}",
        "stable winners": lambda row: f"{row.stable} of {row.winners}",
        "improving winners": lambda row: f"{row.improving} of {row.winners}",
        "best generation": lambda row: row.best_generation,
        "falls in fresh episodes": lambda row: f"{row.falls}",
        "refused by the check": lambda row: f"{row.refused} of {row.trials}",
        "rank correlation": lambda row: "" if row.rank is None else f"{row.rank:.2f}",
        "real episodes": lambda row: f"{row.real_episodes:.0f}",
    }
    columns = {title: [str(tell(row)) for row in results] for title, tell in tellers.items()}
    return {title: cells for title, cells in columns.items() if any(cells) and (unit.falls or title not in BY_FALLS)}
