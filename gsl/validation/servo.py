"""The check of a learned servo before anything is optimised with it: is it near its log, does π0 keep its feet?"""

from __future__ import annotations

from typing import Any

import numpy as np

from gsl.models.servo_file import MAKER
from gsl.rollout.rollout import Scenario
from gsl.storage.references import load
from gsl.training.servo_verdict import problems, problems_of_members, remarks
from gsl.validation.check import pi0_in


def check_servo(
    reference: str, scenario: Scenario, parameters: np.ndarray, seed: int, *, ensemble: bool = False
) -> dict[str, Any]:
    """Return what is known of a learned servo, and why nothing should be optimised with it, if there is a reason.

    Args:
        reference: Path or run of the servo.
        scenario: With its world.
        parameters: Of π0, shape (n_parameters,).
        seed: Of all randomness.
        ensemble: Whether all its members are used.
    """
    metrics, ran = load(reference, MAKER).metrics, pi0_in(scenario, parameters, seed)
    found = problems(metrics) + (problems_of_members(metrics) if ensemble else [])
    if falls := sum(fell for _, fell in ran):
        found.append(f"π0 falls in {falls} of {len(ran)} episodes of the simulator with the learned servo")
    return {
        "floors_before": metrics["floors_before"],
        "floors_after": metrics["floors_after"],
        "groups": metrics["groups"],
        "pi0": {"episodes": len(ran), "falls": falls, "value": float(np.mean([value for value, _ in ran]))},
        "acceptable": not found,
        "problems": found,
        "remarks": remarks(metrics),
    }
