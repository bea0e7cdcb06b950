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


def markdown(found: Sequence[Summary], trials: Sequence[Trial], unit: Unit) -> str:
    """Return the table, the paired differences to the first method, and every single trial.

    Trials are told as improvements where each of them has one to tell, else as what they are worth.
    """
    first, columns, titles = found[0].method, _columns(found, unit), places(found)
    as_shares = all(trial.told_improvement is not None for trial in trials)
    figure, name = ("told_improvement", "improvement") if as_shares else ("value", "value")
    own = SHARE if as_shares else unit
    shown = in_unit(f"{name} in real", own.name)

    single, paired = [], []
    for one in found:
        values = [own.bare(getattr(trial, figure)) + "*" * trial.without for trial in one.own(trials)]
        where = one.cells(titles)
        single.append((*where, one.method, ", ".join(values)))
        if one.method != first:
            apart = differences(trials, Cell(*one[:4]), first, attrgetter(figure))
            cells = (own.bare(apart.mean, sign=True), own.interval([apart.lower, apart.upper]))
            paired.append((*where, f"{one.method} - {first}", *cells))
    parts = [table(tuple(columns), list(zip(*columns.values(), strict=True)))]
    if paired:
        parts.append(f"Differences of the {shown}, paired by trial{' (percentage points)' * as_shares}:\n")
        parts.append(table((*titles, "difference", "mean", "95 % interval"), paired))
    parts.append(f"The {shown} of each trial, in their order; {starred(trials)}:\n")
    return "\n".join([*parts, table((*titles, "grounding", "trials"), single)])


def bounds(interval: Interval, *, sign: bool = False) -> str:
    """Return the bounds of an interval for people."""
    return SHARE.interval([interval.lower, interval.upper], sign=sign)


def finely(interval: Interval) -> str:
    """Return the bounds of an interval of degrees for people; a single value has none."""
    return "-" if math.isinf(interval.lower) else f"{interval.lower:.2f} to {interval.upper:.2f}"


def told_difference(difference: Interval, *, fine: bool = False) -> str:
    """Return a difference and its bounds for people; `fine` of degrees."""
    mean = difference.mean
    return f"{mean:+.2f} ({finely(difference)})" if fine else f"{mean:+.1f} ({bounds(difference)})"


def starred(trials: Sequence[Trial]) -> str:
    """Return what a star behind a trial's figure says: of several iterations it is of that one alone."""
    then = " by that iteration" if any(trial.iteration > 1 for trial in trials) else ""
    return f"* without a stable improvement{then}"


def places(found: Sequence[Summary], told: Sequence[str] = ()) -> dict[str, str]:
    """Return by title the fields that tell where trials were, but for those that a table has `told` already.

    Simulator and iteration are among them only where there are several.
    """
    titles = {"simulator": "simulator", "real world": "world", "iteration": "iteration"}
    several = {name for name in titles.values() if len({getattr(one, name) for one in found}) > 1}
    return {title: name for title, name in titles.items() if name in {*several, "world"} - {*told}}


def _columns(found: Sequence[Summary], unit: Unit) -> Mapping[str, Sequence[str]]:
    """Return the cells below each title, but for columns that have none: without falls there are no stable winners."""
    tellers: dict[str, Callable[[Summary], object]] = {
        **{title: attrgetter(name) for title, name in places(found).items()},
        "grounding": lambda one: one.method,
        f"{in_unit('in real', unit.name)} (95 %)": lambda one: (
            f"{unit.bare(one.value.mean)} ({unit.interval([one.value.lower, one.value.upper])})"
        ),
        "improvement in real [%] (95 %)": lambda one: (
            "" if one.improvement is None else f"{one.improvement.mean:.1f} ({bounds(one.improvement)})"
        ),
        "trials without a gain": lambda one: f"{one.without} of {one.trials}",
        "stable winners": lambda one: f"{one.stable} of {one.winners}",
        "improving winners": lambda one: f"{one.improving} of {one.winners}",
        "best generation": lambda one: one.best_generation,
        "falls in fresh episodes": lambda one: f"{one.falls}",
        "refused by the check": lambda one: f"{one.refused} of {one.trials}",
        "rank correlation": lambda one: "" if one.rank is None else f"{one.rank:.2f}",
        "real episodes": lambda one: f"{one.real_episodes:.0f}",
    }
    columns = {title: [str(tell(one)) for one in found] for title, tell in tellers.items()}
    return {title: cells for title, cells in columns.items() if any(cells) and (unit.falls or title not in BY_FALLS)}
