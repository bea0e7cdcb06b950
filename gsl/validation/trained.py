"""The check of a grounding with a model of its own: real trajectories that are held out, and π0's falls."""

from __future__ import annotations

from gsl.core.interfaces import SIM, Trainable
from gsl.errors import InputError, TrajectoryError
from gsl.grounding.preparation import MAKER
from gsl.rollout.rollout import Scenario
from gsl.storage.references import resolve
from gsl.storage.trajectories import read
from gsl.training.data import HELDOUT
from gsl.validation.check import check
from gsl.validation.gat import show_report
from gsl.validation.gate import Gate, Passed
from gsl.validation.uncharged import warn_uncharged


def check_trained(grounding: Trainable, scenario: Scenario, gate: Gate) -> Passed:
    """Compare the grounded simulator with real trajectories that the grounding has not learned from."""
    ready = scenario.prepare()
    place = resolve(grounding.model, kind=MAKER)
    heldout = (place.parent if place.is_file() else place) / HELDOUT
    if scenario.world.layout.states or not heldout.is_file():
        warn_uncharged(ready.world, gate.console, SIM, "the grounded action")
        return Passed(ready, gate.check_falls(ready, "of the grounded simulator", "Collect more data"))
    try:
        report = check(ready, gate.parameters, read(heldout), gate.seed_of("check"))
    except InputError as error:
        if isinstance(error, TrajectoryError):
            raise
        raise TrajectoryError(heldout, str(error)) from error
    gate.report(report.metrics())
    show_report(report, gate)
    gate.judge(report.problems, "Collect more data")
    return Passed(ready, {"grounding_acceptable": report.acceptable, "grounding_compared": bool(report.deviations)})
