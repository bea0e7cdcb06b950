"""The page of a search: how far did the policy get in the simulator, and what did it learn there?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from gsl.core.unit import Unit
from gsl.core.words import falls, in_unit, several
from gsl.report.charts import Curve, line_chart
from gsl.report.evaluation_cells import name_policy
from gsl.report.iteration_page import grounding
from gsl.report.parts import section, table
from gsl.report.run_page import Answer, Change, budget, parameters, write_page
from gsl.storage.generation_log import Generation
from gsl.storage.policies import PolicyRecord


class Winner(NamedTuple):
    """The best candidate of a generation, whose `value_sim` is a mean, and all candidates of it."""

    policy: PolicyRecord
    generation: Generation

    @property
    def worth(self) -> float:
        """What the search maximises of it."""
        return self.generation.values[self.generation.winner]

    @property
    def mean(self) -> float:
        """What the search maximises, of all candidates."""
        return float(np.mean(self.generation.values))

    @property
    def falls(self) -> int:
        """How often it fell."""
        return self.generation.falls[self.generation.winner]


def write_search_page(
    folder: Path,
    winners: Sequence[Winner],
    tried: Sequence[str],
    best: PolicyRecord,
    metrics: Mapping[str, Any],
    change: Change,
    unit: Unit,
    *,
    check: Mapping[str, Any] | None,
    spent: Sequence[tuple[str, str]],
) -> None:
    """Write the page.

    Args:
        folder: Where to write.
        winners: Of all generations, also those that are not to be tried.
        tried: Names of the policy where the search began, and of those that are.
        best: The best policy.
        metrics: Of the search.
        change: Of the policy, from the first to the best.
        unit: Of the task.
        check: What grounding.json says, if there is one.
        spent: What the search cost in simulation.
    """
    begun = ((check or {}).get("pi0") or {}).get("value")  # the check of a model of states tells none
    beside = "" if begun is None else f", {name_policy(tried[0])} {unit.bare(begun)}"
    generations = several(len(winners), "generation")
    sentence = f"{best.name}, the best of {generations}, reaches {unit.format(best.value_sim)} in simulation{beside}."
    more = ["The best of many had luck as well: only `gsl evaluate` says what it is worth on the real side."]
    if drift := metrics.get("drift"):
        first, *_, last = ((name_policy(name), f"{100.0 * share:.0f} %") for name, share in drift.items())
        spends = f"{last[0]} spends {last[1]} of its time where the grounding has seen nothing"
        more.append(f"{spends}, {first[0]} {first[1]}.")
    failed = (check or {}).get("problems") or []
    sections = [
        section(in_unit("Best of each generation", unit.name), _table(winners, tried, metrics, unit)),
        section("Learning curve in simulation", _curve(winners, unit)),
        grounding(check, []),
        parameters(change),
        budget([("real episodes", "none: a search acts in simulation alone"), *spent]),
    ]
    write_page(folder, Answer("How good a policy does the search find?", sentence, not failed, more), sections)


def _table(winners: Sequence[Winner], tried: Sequence[str], metrics: Mapping[str, Any], unit: Unit) -> Markup:
    """Return a row a generation, with the columns that say something."""
    screened, worth = metrics.get("screened") or {}, "best_cvar_sim" in metrics
    others = any(len(winner.generation.values) > 1 for winner in winners)
    columns = ["generation", "in simulation"]
    columns += ["mean of its worst episodes"] * worth + ["mean of all candidates"] * others
    columns += ["falls of the best"] * unit.falls + ["falls of all candidates"] * (unit.falls and others)
    columns += ["in the screening"] * bool(screened)
    rows = []
    for winner in winners:
        cells = [winner.policy.name, unit.bare(winner.policy.value_sim)]
        cells += [unit.bare(winner.worth)] * worth + [unit.bare(winner.mean)] * others
        cells += [str(winner.falls)] * unit.falls + [str(sum(winner.generation.falls))] * (unit.falls and others)
        if screened:
            result, out = screened[winner.policy.name], "" if winner.policy.name in tried else ", not kept"
            cells.append(f"{falls(result['falls'])} in {result['episodes']}{out}")
        rows.append(cells)
    return table(columns, rows)


def _curve(winners: Sequence[Winner], unit: Unit) -> Markup | None:
    """Return the best and the mean of each generation; one generation is no curve."""
    if len(winners) < 2:
        return None
    numbers = [float(winner.policy.generation or 0) for winner in winners]
    curves = [
        Curve(label, kind, numbers, [unit.factor * value for value in values])
        for label, kind, values in (
            ("mean of all candidates", "command", [winner.mean for winner in winners]),
            ("best candidate", "before", [winner.worth for winner in winners]),
        )
    ]
    return line_chart(curves, x="generation", y=in_unit("value", unit.name), counted=True)
