"""The check of diagnosed effects before anything is optimised with them: does the gap shrink, does π0 keep its feet?"""

from __future__ import annotations

from typing import Any

import numpy as np

from gsl.grounding.effects import Diagnosis
from gsl.rollout.rollout import Scenario
from gsl.validation.check import pi0_in


def check_effects(found: Diagnosis, scenario: Scenario, parameters: np.ndarray, seed: int) -> dict[str, Any]:
    """Return what is known of diagnosed effects, and why nothing should be optimised with them, if there is a reason.

    Args:
        found: The diagnosis.
        scenario: With its world.
        parameters: Of π0, shape (n_parameters,).
        seed: Of all randomness.
    """
    ran, problems = pi0_in(scenario, parameters, seed), []
    if found.causes and found.after is not None and found.before is not None and found.after >= found.before:
        gaps = f"{found.after:.1f} noise floors with the effects, {found.before:.1f} without"
        problems.append(f"held out, the gap is {gaps}")
    if falls := sum(fell for _, fell in ran):
        problems.append(f"π0 falls in {falls} of {len(ran)} episodes of the diagnosed simulator")
    return {
        "diagnosis": found.verdict,
        "effects": found.effects,
        "gap": {"before": found.before, "after": found.after},
        "pi0": {"episodes": len(ran), "falls": falls, "value": float(np.mean([value for value, _ in ran]))},
        "acceptable": not problems,
        "problems": problems,
    }
