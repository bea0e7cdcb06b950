"""What a study's page says first: how one method differs from another, with its interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import attrgetter

from gsl.core.statistics import Interval
from gsl.core.unit import Unit
from gsl.core.words import several
from gsl.report.run_page import Answer
from gsl_experiments.comparison import Summary, differences
from gsl_experiments.trial import Cell, Trial

CHOSEN = ("The interval does not count that the best of several methods was chosen.",)
QUESTION = "Which grounding leads to better policies on the real side?"


def is_significant(difference: Interval) -> bool:
    """Whether an interval leaves out 0; that of a single trial is infinite."""
    return difference.lower > 0.0 or difference.upper < 0.0


def name_difference(what: str, difference: Interval, unit: Unit) -> str:
    """Return a difference with its interval in a sentence.

    Args:
        what: Of what to what, such as `gat minus none`.
        difference: Its mean with its interval, in the unit of the task.
        unit: How it is shown.
    """
    line = tell_difference(what, difference, unit)
    if math.isinf(difference.upper):
        return f"{line}."
    return f"{line}, which is {'' if is_significant(difference) else 'not '}significant."


def tell_difference(what: str, difference: Interval, unit: Unit) -> str:
    """Return a difference with its interval, as `name_difference` without its verdict."""
    mean = f"{what}: {_finely(difference.mean, unit, sign=True)}"
    if math.isinf(difference.upper):
        return f"{mean}, in a single trial, which gives no interval"
    return f"{mean} (95 % {unit.interval([difference.lower, difference.upper], sign=True)})"


def _finely(value: float, unit: Unit, *, sign: bool = False) -> str:
    """Return a value with a digit more than tables have, so that a difference is that of the values beside it."""
    return f"{unit.factor * value:{'+' if sign else ''}.2f} {unit.name}" if unit.name else unit.format(value, sign=sign)


def answer_difference(question: str, what: str, difference: Interval, unit: Unit, more: Sequence[str] = ()) -> Answer:
    """Return the answer that one difference is."""
    return Answer(question, name_difference(what, difference, unit), is_significant(difference), more)


def _say(method: str) -> str:
    """Return what a sentence calls a method: `none is best` would say that no method is."""
    return "the search without grounding" if method == "none" else method


def answer_comparison(results: Sequence[Summary], trials: Sequence[Trial], unit: Unit) -> Answer:
    """Return how the best method of each world stands to the first method, or to the next best if that is the first.

    Args:
        results: Of all trials.
        trials: All of them.
        unit: Of the task.
    """
    first, sentences, sure = results[0].method, list[str](), True
    for key in dict.fromkeys((summary.simulator, summary.world, summary.iteration) for summary in results):
        own = [summary for summary in results if (summary.simulator, summary.world, summary.iteration) == key]
        best = max(own, key=lambda summary: summary.value.mean)
        place = ", ".join(filter(None, (best.simulator, best.world)))
        place += f", iteration {best.iteration}" if any(summary.iteration > 1 for summary in results) else ""
        worth = _finely(best.value.mean, unit)
        if not math.isinf(best.value.upper):
            worth += f" (95 % {unit.interval([best.value.lower, best.value.upper])})"
        winner = _say(best.method)
        others = [summary for summary in own if summary.method != best.method]
        if not others:
            sentences.append(f"In {place}, {winner} alone was tried, with {worth}.")
            sure = False
            continue
        other = max(others, key=lambda summary: (summary.method == first, summary.value.mean))
        apart = differences(trials, Cell(*best[:4]), other.method, attrgetter("value"))
        line = tell_difference(f"{winner} minus {_say(other.method)}", apart, unit)
        if is_significant(apart):
            lead = f"{winner} is best of {several(len(own), 'method')} with {worth}"
            line += ", which is significant"
        else:
            sureness = "significant" if not math.isinf(apart.upper) else "sure"
            lead = f"no difference between {winner} and {_say(other.method)} is {sureness}: {worth} and "
            lead += _finely(other.value.mean, unit)
        sentences.append(f"In {place}, {lead}; {line}.")
        sure = sure and is_significant(apart)
    more = CHOSEN if len({summary.method for summary in results}) > 2 else ()
    return Answer(QUESTION, sentences[0], sure, [*sentences[1:], *more])
