"""The page of an evaluation: which policy is the best on the real side, and by how much?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup

from gsl.core.unit import Unit
from gsl.report.account import describe_choice, evaluation_table
from gsl.report.footfalls import Walk
from gsl.report.iteration_page import grounding, read_check
from gsl.report.joint_trace import Traces
from gsl.report.learning_curve import search
from gsl.report.parts import section, table
from gsl.report.run_page import (
    Answer,
    Change,
    budget,
    curves,
    describe_gain,
    footfalls,
    joints,
    parameters,
    rank_joints,
    write_page,
)

_CAPTION = "A fresh episode on the real side, the first with a fall if there was one."
_REPLAYED = " Simulators start in one of its states and play its actions."
_PHASES = {"policies": "episodes to choose", "check": "episodes to check", "confirmation": "fresh episodes to report"}


class Look(NamedTuple):
    """What there is to see of the policies that were reported.

    Attributes:
        traces: Of each policy by joint, the best one first; none where there are no joints.
        walks: Whose feet are known.
        check: Where the check of a grounding lies, if the policies are of a search.
        findings: What that grounding had learned, a sentence each.
    """

    traces: Mapping[str, Mapping[str, Traces]] = {}
    walks: Sequence[Walk] = ()
    check: Path | None = None
    findings: Sequence[str] = ()


def write_evaluation_page(
    folder: Path, metrics: Mapping[str, Any], document: Mapping[str, Any], change: Change, unit: Unit, look: Look
) -> None:
    """Write the page.

    Args:
        folder: Where to write.
        metrics: Of the evaluation.
        document: What evaluation.json holds.
        change: Of the policy, from the first to the best.
        unit: Of the task.
        look: What there is to see.
    """
    alone, choice = not metrics["policies"], describe_choice(metrics, unit)
    sentence, sure = f"{choice[0] if choice.startswith('π') else choice[0].upper()}{choice[1:]}.", alone
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
        None if alone else curves([searched], unit.name),
        grounding(read_check(look.check) if look.check else None, look.findings),
        *_draw_joints(look),
        footfalls(look.walks),
        None if alone else parameters(change),
        budget([*spent, ("in all", str(metrics["real_episodes"]))]),
    ]
    write_page(folder, answer, sections)


def _draw_joints(look: Look) -> Iterator[Markup | None]:
    """Yield a section a policy; simulators are there where the policies are of a search."""
    order = rank_joints(*look.traces.values())  # whoever compares two policies looks at the same joint
    for name, own in look.traces.items():
        traces = {joint: own[joint] for joint in order if joint in own}
        replayed = any(trace.simulation is not None for trace in traces.values())
        yield joints(traces, _CAPTION + _REPLAYED * replayed, f"Joint by joint: {name}")
