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
    mean = f"{what}: {unit.format(difference.mean, sign=True)}"
    if math.isinf(difference.upper):
        return f"{mean}, in a single trial, which gives no interval."
    bounds = unit.interval([difference.lower, difference.upper], sign=True)
    return f"{mean} (95 % {bounds}), which is {'' if is_significant(difference) else 'not '}significant."


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
        worth = unit.format(best.value.mean)
        if not math.isinf(best.value.upper):
            worth += f" (95 % {unit.interval([best.value.lower, best.value.upper])})"
        best_of = f"In {place}, {_say(best.method)} is best of {several(len(own), 'method')} with {worth}"
        others = [summary for summary in own if summary.method != best.method]
        if not others:
            sentences.append(f"{best_of}.")
            sure = False
            continue
        beside = max(others, key=lambda summary: (summary.method == first, summary.value.mean)).method
        apart = differences(trials, Cell(*best[:4]), beside, attrgetter("value"))
        sentences.append(name_difference(f"{best_of}; {_say(best.method)} minus {_say(beside)}", apart, unit))
        sure = sure and is_significant(apart)
    more = CHOSEN if len({summary.method for summary in results}) > 2 else ()
    return Answer(QUESTION, sentences[0], sure, [*sentences[1:], *more])
