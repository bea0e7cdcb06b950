"""The check of a learned servo before anything is optimised with it: is it near its log, does π0 keep its feet?"""

from __future__ import annotations

from typing import Any

import numpy as np

from gsl.grounding.servo import LearnedServo
from gsl.models.servo_file import MAKER
from gsl.rollout.rollout import Scenario
from gsl.storage.references import load
from gsl.training.servo_verdict import problems, problems_of_members, remarks
from gsl.validation.check import pi0_in
from gsl.validation.gate import Gate, Passed, examine


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
    complaints = problems(metrics) + (problems_of_members(metrics) if ensemble else [])
    if falls := sum(fell for _, fell in ran):
        complaints.append(f"π0 falls in {falls} of {len(ran)} episodes of the simulator with the learned servo")
    return {
        "floors_before": metrics["floors_before"],
        "floors_after": metrics["floors_after"],
        "groups": metrics["groups"],
        "pi0": {"episodes": len(ran), "falls": falls, "value": float(np.mean([value for value, _ in ran]))},
        "acceptable": not complaints,
        "problems": complaints,
        "remarks": remarks(metrics),
    }


@examine.register
def check_learned_servo(grounding: LearnedServo, scenario: Scenario, gate: Gate) -> Passed:
    """Switch a learned servo on, if it is near enough to the log that it was learned from."""
    ready, place = scenario.prepare(), grounding.at_its_place().servo
    report = check_servo(place, ready, gate.parameters, gate.seed_of("check"), ensemble=grounding.ensemble)
    gate.report(report)
    for line in report["remarks"]:
        gate.console.status(f"warning: {line}")
    gate.judge(report["problems"], "Log more motions, or learn on top of a diagnosis (grounding=effects_servo)")
    floors = {"floors_before": report["floors_before"], "floors_after": report["floors_after"]}
    gate.show_members(ready.world)
    return Passed(ready, {"servo": floors, "grounding_acceptable": report["acceptable"]})
