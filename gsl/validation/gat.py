"""The check of a grounded action transformation, against real trajectories that no model has seen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gsl.core.interfaces import SIM
from gsl.core.trajectory import Batch
from gsl.errors import ConfigError, InputError, TrajectoryError
from gsl.grounding.gat import ActionTransformation, LoadedTransformation
from gsl.grounding.random_choice import exploration
from gsl.report.grounding_errors import grounding_errors
from gsl.rollout.rollout import Scenario
from gsl.storage.models import model_file, read_forward_model, read_inverse_model
from gsl.storage.trajectories import read
from gsl.training.data import HELDOUT, VALIDATION, of_policy
from gsl.validation.check import ALPHAS, REPLAYS, check, count_allowed_falls, largest_stable
from gsl.validation.fewest_joints import fewest
from gsl.validation.gate import Gate, Passed, examine
from gsl.validation.replay import places
from gsl.validation.report import TITLES, GroundingReport
from gsl.validation.uncharged import warn_uncharged
from gsl.validation.values_of_states import TITLES as VALUE_TITLES
from gsl.validation.values_of_states import value_report

FIGURE = "grounding.png"


@examine.register
def check_transformation(grounding: ActionTransformation, scenario: Scenario, gate: Gate) -> Passed:
    """Load models, settle alpha, and compare with held-out real trajectories."""
    gate.console.phase("checking the grounded simulator against held-out real trajectories")
    loaded = grounding.load(read_forward_model, read_inverse_model)
    folder = model_file(grounding.forward_model, "forward_model").parent
    heldout = read(folder / HELDOUT)
    if not isinstance(loaded, LoadedTransformation):
        return _check_values(replace(scenario, grounding=loaded), heldout, gate)
    if grounding.x == "auto":
        loaded = replace(loaded, x=_choose_joints(scenario, loaded, read(folder / VALIDATION), gate))
    if grounding.alpha == "auto":
        tried = {alpha: replace(scenario, grounding=replace(loaded, alpha=alpha)) for alpha in ALPHAS}
        allowed = count_allowed_falls(heldout)
        alpha = largest_stable(tried, gate.parameters, gate.seed_of("alpha"), allowed=allowed)
        loaded = replace(loaded, alpha=alpha)
    ready, judged = compare(replace(scenario, grounding=loaded), heldout, folder / HELDOUT, gate)
    return Passed(ready, {"alpha": loaded.alpha, "x": loaded.x, **judged})


def compare(ready: Scenario, heldout: Batch, file: Path, gate: Gate) -> Passed:
    """Compare the grounded simulator with real trajectories that are held out, and stand in a file.

    Raises:
        Refused: It is not near enough, and `gate.accept` is not set.
        TrajectoryError: Nothing can be compared with these trajectories.
    """
    try:
        report = check(ready, gate.parameters, heldout, gate.seed_of("check"))
    except InputError as error:
        if isinstance(error, TrajectoryError):
            raise
        raise TrajectoryError(file, str(error)) from error
    gate.report(report.metrics())
    _show_report(report, gate)
    gate.judge(report.problems, "Collect more data")
    return Passed(ready, {"grounding_acceptable": report.acceptable, "grounding_compared": bool(report.deviations)})


def _show_report(report: GroundingReport, gate: Gate) -> None:
    """Show a report as a table and a figure, and what it lacks."""
    if report.deviations:
        grounding_errors(gate.folder / FIGURE, report.by_joint())
        gate.console.table("grounded simulator against held-out real trajectories", TITLES, report.rows())
    else:
        lack = f"the real trajectories lack {', '.join(report.lacking)}"
        problem = lack if report.lacking else "the held-out real trajectories are too short"
        only = "no simulation can start from them: of the grounding only the falls of π0 in it were checked"
        gate.console.status(f"warning: {problem}, so {only}")
    if report.remark:
        gate.console.status(f"{report.remark}, whatever its joints are: look at what the search returns")
    if report.reach:
        gate.console.status(report.reach.sentence)


def _check_values(ready: Scenario, heldout: Batch, gate: Gate) -> Passed:
    """Compare what π0 is worth with held-out real episodes."""
    warn_uncharged(ready.world, gate.console, SIM, "the grounded action")
    if not (real := of_policy(heldout, pi0=True)):
        problem = "no real episode of π0 is held out, so the grounding was not checked; collect a few more"
        gate.console.status(f"warning: {problem}")
        return Passed(ready, {})
    noise = exploration(heldout.metadata.get("action_noise", 0.0), ready.world.layout)
    report = value_report(ready, gate.parameters, real, noise, gate.seed_of("check"))
    gate.report(report.metrics())
    gate.console.table("π0 in the grounded simulator", VALUE_TITLES, report.rows(), report.sentence)
    gate.judge(report.problems, "Collect more data")
    return Passed(ready, {"grounding_acceptable": not report.problems})


def _choose_joints(scenario: Scenario, loaded: LoadedTransformation, validation: Batch, gate: Gate) -> tuple[str, ...]:
    """Return the joints to ground, and show them."""
    env = scenario.world.make()
    try:
        starts = places(validation.episodes, scenario.world.layout, REPLAYS)
    except KeyError as error:
        problem = f"needs {error.args[0]} in the real trajectories, to try joints out; name the joints"
        raise ConfigError("grounding.x", problem, given="auto") from error
    joints = fewest(env, loaded, starts, gate.seed_of("x"))
    env.close()
    gate.console.status(f"grounding {len(joints)} of {len(loaded.forward.joints)} joints: {', '.join(joints)}")
    return joints
