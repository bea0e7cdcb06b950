"""The check of any grounding before a search."""

from __future__ import annotations

from gsl.core.interfaces import SIM, Trainable
from gsl.grounding.preparation import MAKER
from gsl.rollout.rollout import Scenario
from gsl.storage.references import resolve
from gsl.storage.trajectories import read
from gsl.training.data import HELDOUT
from gsl.validation.gat import compare
from gsl.validation.gate import Gate, Passed, examine
from gsl.validation.uncharged import warn_uncharged


def check_grounding(scenario: Scenario, gate: Gate) -> Passed:
    """Return the scenario with its grounding ready to act, in the world that it makes, and what to report of it.

    Raises:
        Refused: The grounding fails its check and `gate.accept` is not set.
    """
    grounding = scenario.grounding
    if isinstance(grounding, Trainable):
        return _check_trainable(grounding, scenario, gate)
    return examine(grounding, scenario, gate)


def _check_trainable(grounding: Trainable, scenario: Scenario, gate: Gate) -> Passed:
    """Compare the grounded simulator with real trajectories that the grounding has not learned from."""
    ready = scenario.prepare()
    place = resolve(grounding.model, kind=MAKER)
    heldout = (place.parent if place.is_file() else place) / HELDOUT
    if scenario.world.layout.states or not heldout.is_file():
        warn_uncharged(ready.world, gate.console, SIM, "the grounded action")
        return Passed(ready, gate.check_falls(ready, "of the grounded simulator", "Collect more data"))
    return compare(ready, read(heldout), heldout, gate)
