"""The page of an evaluation: which policy is the best on the real side, and by how much?"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gsl.core.unit import Unit
from gsl.report.account import describe_choice, evaluation_table
from gsl.report.learning_curve import search
from gsl.report.parts import section, table
from gsl.report.run_page import Answer, Change, budget, curves, describe_gain, parameters, write_page

_PHASES = {"policies": "episodes to choose", "check": "episodes to check", "confirmation": "fresh episodes to report"}


def write_evaluation_page(
    folder: Path, metrics: Mapping[str, Any], document: Mapping[str, Any], change: Change, unit: Unit
) -> None:
    """Write the page.

    Args:
        folder: Where to write.
        metrics: Of the evaluation.
        document: What evaluation.json holds.
        change: Of the policy, from the first to the best.
        unit: Of the task.
    """
    alone, choice = not metrics["policies"], describe_choice(metrics, unit)
    sentence, sure = f"{choice[0].upper()}{choice[1:]}.", alone
    question = f"{'How good is this policy' if alone else 'Which of these policies is the best'} on the real side?"
    if metrics["best_generation"]:
        after, before, gain = (metrics[key] for key in ("returned", "baseline", "gain"))
        sentence, sure = describe_gain(metrics["best"], after, before, gain, unit)
    broken = (metrics.get("promise") or {}).get("warning", "")
    answer = Answer(question, sentence, sure, [f"{broken[0].upper()}{broken[1:]}."] if broken else [])
    columns, rows = evaluation_table(document, unit)
    searched = search("all policies", document, shown=unit.factor, returned=metrics["best"], start="π0")
    spent = [(words, str(sum(row["episodes"] for row in document[phase]))) for phase, words in _PHASES.items()]
    sections = [
        section("Policies on the real side", table(columns, rows)),
        *([] if alone else [curves([searched], unit.name), parameters(change)]),
        budget([*spent, ("in all", str(metrics["real_episodes"]))]),
    ]
    write_page(folder, answer, sections)
