"""The check of any grounding before a search."""

from __future__ import annotations

from gsl.core.interfaces import Trainable
from gsl.rollout.rollout import Scenario
from gsl.validation.gate import Gate, Passed, examine
from gsl.validation.trained import check_trained


def check_grounding(scenario: Scenario, gate: Gate) -> Passed:
    """Return the scenario with its grounding ready to act, in the world that it makes, and what to report of it.

    Raises:
        Refused: The grounding fails its check and `gate.accept` is not set.
    """
    grounding = scenario.grounding
    if isinstance(grounding, Trainable):
        return check_trained(grounding, scenario, gate)
    return examine(grounding, scenario, gate)
