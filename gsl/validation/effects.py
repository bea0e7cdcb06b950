"""The check of diagnosed effects before anything is optimised with them: does the gap shrink, does π0 keep its feet?"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np

from gsl.core.interfaces import Trainable
from gsl.grounding.diagnosis_file import Diagnosis, read_diagnosis
from gsl.grounding.effects import DiagnosedEffects, switch_on
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.servo import LearnedServo
from gsl.rollout.rollout import Scenario
from gsl.validation.check import pi0_in
from gsl.validation.check_grounding import check_grounding
from gsl.validation.gate import REPORT, Gate, Passed, examine


def check_effects(diagnosis: Diagnosis, scenario: Scenario, parameters: np.ndarray, seed: int) -> dict[str, Any]:
    """Return what is known of diagnosed effects, and why nothing should be optimised with them, if there is a reason.

    Args:
        diagnosis: The diagnosis.
        scenario: With its world.
        parameters: Of π0, shape (n_parameters,).
        seed: Of all randomness.
    """
    ran, problems = pi0_in(scenario, parameters, seed), []
    if (
        diagnosis.causes
        and diagnosis.after is not None
        and diagnosis.before is not None
        and diagnosis.after >= diagnosis.before
    ):
        gaps = f"{diagnosis.after:.1f} noise floors with the effects, {diagnosis.before:.1f} without"
        problems.append(f"held out, the gap is {gaps}")
    if falls := sum(fell for _, fell in ran):
        problems.append(f"π0 falls in {falls} of {len(ran)} episodes of the diagnosed simulator")
    return {
        "diagnosis": diagnosis.verdict,
        "effects": diagnosis.effects,
        "gap": {"before": diagnosis.before, "after": diagnosis.after},
        "pi0": {"episodes": len(ran), "falls": falls, "value": float(np.mean([value for value, _ in ran]))},
        "acceptable": not problems,
        "problems": problems,
    }


@examine.register
def check_diagnosed_effects(grounding: DiagnosedEffects, scenario: Scenario, gate: Gate) -> Passed:
    """Switch effects on; an inner grounding that learns is checked in the world that they make."""
    diagnosis = grounding.load(read_diagnosis)
    gate.console.status(diagnosis.sentence)
    about = {"effects": list(diagnosis.causes), "diagnosis": diagnosis.verdict}
    inside = replace(scenario, world=switch_on(scenario.world, diagnosis), grounding=grounding.inner)
    ready, checked = check_grounding(inside, gate)
    own, path = isinstance(grounding.inner, ActionTransformation | LearnedServo | Trainable), gate.folder / REPORT
    before = json.loads(path.read_text(encoding="utf-8")) if own and path.exists() else {}
    ready = replace(ready, world=grounding.draw(ready.world, diagnosis))
    if grounding.draws or not own:
        report = check_effects(diagnosis, ready, gate.parameters, gate.seed_of("check"))
        gate.report({**before, "drawn": report} if own else report)
        passed = report["acceptable"] and checked.get("grounding_acceptable", True)
        checked = {**checked, "grounding_acceptable": passed}
        gate.judge(report["problems"], "Diagnose again")
    if grounding.draws:
        gate.show_members(ready.world)
    return Passed(ready, {**about, **checked})
