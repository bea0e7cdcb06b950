"""The check of torque noise: does π0 keep its feet?"""

from __future__ import annotations

from gsl.grounding.torque_noise import TorqueNoise
from gsl.rollout.rollout import Scenario
from gsl.validation.gate import Gate, Passed, examine


@examine.register
def check_torque_noise(grounding: TorqueNoise, scenario: Scenario, gate: Gate) -> Passed:
    """Switch torque noise on; all that can be checked of it is whether π0 keeps its feet."""
    ready = scenario.prepare()
    gate.console.status(grounding.description)
    advice = "Lower grounding.step or grounding.constant"
    return Passed(ready, gate.check_falls(ready, f"with {grounding.description}", advice))
