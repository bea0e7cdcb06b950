"""The gate before a search: a grounding that makes the simulator no better is refused, with the report that says so."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.interfaces import SIM, World
from gsl.core.seeds import derived_seed
from gsl.core.trajectory import Batch
from gsl.diagnosis.files import read_diagnosis
from gsl.errors import ConfigError, InputError, Refused, TrajectoryError
from gsl.grounding.effects import DiagnosedEffects, switched_on
from gsl.grounding.gat import ActionTransformation, LoadedTransformation
from gsl.grounding.none import NoGrounding
from gsl.grounding.random_choice import exploration
from gsl.grounding.randomised import RandomisedEffects, randomised
from gsl.grounding.servo import LearnedServo
from gsl.grounding.torque_noise import TorqueNoise
from gsl.models.servo_file import MAKER
from gsl.report.grounding_errors import grounding_errors
from gsl.rollout.rollout import Scenario
from gsl.storage.documents import write_json
from gsl.storage.models import model_file, read_forward_model, read_inverse_model
from gsl.storage.references import resolve
from gsl.storage.trajectories import read
from gsl.training.data import HELDOUT, VALIDATION, of_policy
from gsl.validation.check import ALPHAS, EPISODES, REPLAYS, allowed_falls, check, largest_stable, pi0_in
from gsl.validation.effects import check_effects
from gsl.validation.fewest_joints import fewest
from gsl.validation.replay import places
from gsl.validation.report import TITLES
from gsl.validation.servo import check_servo
from gsl.validation.uncharged import warn_uncharged
from gsl.validation.values_of_states import TITLES as VALUE_TITLES
from gsl.validation.values_of_states import value_report
from gsl.worlds.ensemble import EnsembleWorld

REPORT, FIGURE = "grounding.json", "grounding.png"


def grounding_parents(grounding: Any, path: str = "grounding") -> Mapping[str, Path]:
    """Return what a grounding is made of, by role: the dotted name of the setting, seen from `path`."""
    if isinstance(grounding, DiagnosedEffects):
        own = {} if grounding.effects else {f"{path}.diagnosis": resolve(grounding.diagnosis, kind=grounding.method)}
        return {**own, **grounding_parents(grounding.inner, f"{path}.inner")}
    if isinstance(grounding, LearnedServo):
        return {f"{path}.servo": resolve(grounding.servo, kind=MAKER)}
    if not isinstance(grounding, ActionTransformation):
        return {}
    return {
        f"{path}.forward_model": resolve(grounding.forward_model, kind="train_forward"),
        f"{path}.inverse_model": resolve(grounding.inverse_model, kind="train_inverse"),
    }


def settled(scenario: Scenario, found: Mapping[str, Any]) -> Scenario:
    """Return a scenario ready to act with what a search settled of its grounding (its metrics), without a check."""
    grounding = scenario.grounding
    if isinstance(grounding, DiagnosedEffects):
        diagnosis = grounding.load(read_diagnosis)
        world = switched_on(scenario.world, diagnosis)
        inside = settled(replace(scenario, world=world, grounding=grounding.inner), found)
        return replace(inside, world=grounding.drawn(inside.world, diagnosis))
    if isinstance(grounding, ActionTransformation):
        chosen = replace(grounding, alpha=found["alpha"], x=tuple(found["x"])) if "x" in found else grounding
        return replace(scenario, grounding=chosen.load(read_forward_model, read_inverse_model))
    if isinstance(grounding, RandomisedEffects):
        world = randomised(scenario.world, grounding, found["width"])
        return replace(scenario, world=world, grounding=NoGrounding())
    if isinstance(grounding, LearnedServo):
        grounding = at_its_place(grounding)
        return replace(scenario, world=grounding.switched_on(scenario.world), grounding=grounding.actions)
    if isinstance(grounding, TorqueNoise):
        return replace(scenario, world=grounding.switched_on(scenario.world), grounding=NoGrounding())
    return scenario


def at_its_place(grounding: LearnedServo) -> LearnedServo:
    """Return a grounding whose servo is named by its folder, whatever run or file it was asked for by."""
    place = resolve(grounding.servo, kind=MAKER)
    return replace(grounding, servo=str(place.parent if place.is_file() else place))


@dataclass(frozen=True)
class Gate:
    """What a grounding has to pass on its way into a search.

    Attributes:
        parameters: Of π0, shape (n_parameters,).
        folder: Where its report goes.
        console: Where it is told.
        accept: Whether it may pass in spite of problems.
        seed: Of all randomness.
    """

    parameters: np.ndarray
    folder: Path
    console: Any
    accept: bool
    seed: int

    def passed(self, scenario: Scenario) -> tuple[Scenario, Mapping[str, Any]]:
        """Return the scenario with a grounding ready to act, in the world that it makes, and what to report of it.

        Raises:
            Refused: The grounding fails its check and `accept` is not set.
        """
        if isinstance(scenario.grounding, DiagnosedEffects):
            return self._diagnosed(scenario, scenario.grounding)
        if isinstance(scenario.grounding, ActionTransformation):
            return self._transformed(scenario, scenario.grounding)
        if isinstance(scenario.grounding, RandomisedEffects):
            return self._randomised(scenario, scenario.grounding)
        if isinstance(scenario.grounding, LearnedServo):
            return self._having_servo(scenario, scenario.grounding)
        if isinstance(scenario.grounding, TorqueNoise):
            return self._shaken(scenario, scenario.grounding)
        self._charged(scenario)
        return scenario, {}

    def _randomised(self, scenario: Scenario, settings: RandomisedEffects) -> tuple[Scenario, Mapping[str, Any]]:
        """Settle the width; of what knows nothing of the real robot there is nothing else to check."""
        bare, seed = replace(scenario, grounding=NoGrounding()), derived_seed(self.seed, "width")
        worlds = {width: replace(bare, world=randomised(bare.world, settings, width)) for width in settings.widths}
        width = largest_stable(worlds, self.parameters, seed)
        share = f"{100 * width:.0f} % of the documented ranges"
        self.console.status(f"drawing from {share}")
        fell = sum(fell for _, fell in pi0_in(worlds[width], self.parameters, seed)) if width == min(worlds) else 0
        problems = [f"π0 falls in {fell} of {EPISODES} episodes that draw from {share}"] if fell else []
        write_json(self.folder / REPORT, {"width": width, "acceptable": not problems, "problems": problems})
        self._judge(problems, "Lower grounding.width")
        return worlds[width], {"width": width, "grounding_acceptable": not problems}

    def _shaken(self, scenario: Scenario, settings: TorqueNoise) -> tuple[Scenario, Mapping[str, Any]]:
        """Switch torque noise on; all that can be checked of it is whether π0 keeps its feet."""
        ready = replace(scenario, world=settings.switched_on(scenario.world), grounding=NoGrounding())
        fell = sum(fell for _, fell in pi0_in(ready, self.parameters, derived_seed(self.seed, "check")))
        self.console.status(settings.description)
        problems = [f"π0 falls in {fell} of {EPISODES} episodes with {settings.description}"] if fell else []
        write_json(self.folder / REPORT, {"acceptable": not problems, "problems": problems})
        self._judge(problems, "Lower grounding.step or grounding.constant")
        return ready, {"grounding_acceptable": not problems}

    def _having_servo(self, scenario: Scenario, settings: LearnedServo) -> tuple[Scenario, Mapping[str, Any]]:
        """Switch a learned servo on, if it is near enough to the log that it was learned from."""
        settings = at_its_place(settings)
        ready = replace(scenario, world=settings.switched_on(scenario.world), grounding=settings.actions)
        seed = derived_seed(self.seed, "check")
        report = check_servo(settings.servo, ready, self.parameters, seed, ensemble=settings.ensemble)
        write_json(self.folder / REPORT, report)
        for line in report["remarks"]:
            self.console.status(f"warning: {line}")
        self._judge(report["problems"], "Log more motions, or learn on top of a diagnosis (grounding=effects_servo)")
        floors = {"floors_before": report["floors_before"], "floors_after": report["floors_after"]}
        self._in_turn(ready.world)
        return ready, {"servo": floors, "grounding_acceptable": report["acceptable"]}

    def _diagnosed(self, scenario: Scenario, settings: DiagnosedEffects) -> tuple[Scenario, Mapping[str, Any]]:
        """Switch effects on; an inner grounding that learns is checked in the world that they make."""
        found = settings.load(read_diagnosis)
        self.console.status(found.told)
        inside = replace(scenario, world=switched_on(scenario.world, found), grounding=settings.inner)
        about = {"effects": list(found.causes), "diagnosis": found.verdict}
        ready, checked = self.passed(inside)
        own = isinstance(settings.inner, ActionTransformation | LearnedServo)
        report_file = self.folder / REPORT
        before = json.loads(report_file.read_text(encoding="utf-8")) if own and report_file.exists() else {}
        ready = replace(ready, world=settings.drawn(ready.world, found))
        if settings.draws or not own:
            report = check_effects(found, ready, self.parameters, derived_seed(self.seed, "check"))
            write_json(report_file, {**before, "drawn": report} if own else report)
            passed = report["acceptable"] and checked.get("grounding_acceptable", True)
            checked = {**checked, "grounding_acceptable": passed}
            self._judge(report["problems"], "Diagnose again")
        if settings.draws:
            self._in_turn(ready.world)
        return ready, {**about, **checked}

    def _in_turn(self, world: World) -> None:
        if isinstance(world, EnsembleWorld):
            self.console.status(f"every episode of the search is in one of {len(world.members)} simulators")

    def _transformed(self, scenario: Scenario, settings: ActionTransformation) -> tuple[Scenario, Mapping[str, Any]]:
        """Load models, settle alpha, and compare with held-out real trajectories."""
        self.console.status("checking the grounded simulator against held-out real trajectories")
        loaded = settings.load(read_forward_model, read_inverse_model)
        folder = model_file(settings.forward_model, "forward_model").parent
        if not isinstance(loaded, LoadedTransformation):
            return self._of_states(replace(scenario, grounding=loaded), read(folder / HELDOUT))
        if settings.x == "auto":
            loaded = replace(loaded, x=self._chosen(scenario, loaded, read(folder / VALIDATION)))
        ready = replace(scenario, grounding=loaded)
        heldout = read(folder / HELDOUT)
        if settings.alpha == "auto":
            tried = {alpha: replace(ready, grounding=replace(loaded, alpha=alpha)) for alpha in ALPHAS}
            seed, allowed = derived_seed(self.seed, "alpha"), allowed_falls(heldout)
            ready = tried[largest_stable(tried, self.parameters, seed, allowed=allowed)]
        try:
            report = check(ready, self.parameters, heldout, derived_seed(self.seed, "check"))
        except InputError as error:
            if isinstance(error, TrajectoryError):
                raise
            raise TrajectoryError(folder / HELDOUT, str(error)) from error
        write_json(self.folder / REPORT, report.metrics())
        if report.deviations:
            grounding_errors(self.folder / FIGURE, report.by_joint())
            self.console.table("grounded simulator against held-out real trajectories", TITLES, report.rows())
        else:
            lack = f"the real trajectories lack {', '.join(report.lacking)}"
            problem = lack if report.lacking else "the held-out real trajectories are too short"
            only = "no simulation can start from them: of the grounding only the falls of π0 in it were checked"
            self.console.status(f"warning: {problem}, so {only}")
        if report.remark:
            self.console.status(f"{report.remark}, whatever its joints are: look at what the search returns")
        if report.reach:
            self.console.status(report.reach.told)
        self._judge(report.problems, "Collect more data")
        judged = {"grounding_acceptable": report.acceptable, "grounding_compared": bool(report.deviations)}
        return ready, {"alpha": report.alpha, "x": loaded.x, **judged}

    def _of_states(self, ready: Scenario, heldout: Batch) -> tuple[Scenario, Mapping[str, Any]]:
        """Compare what π0 is worth with held-out real episodes."""
        self._charged(ready)
        if not (real := of_policy(heldout, pi0=True)):
            problem = "no real episode of π0 is held out, so the grounding was not checked; collect a few more"
            self.console.status(f"warning: {problem}")
            return ready, {}
        noise = exploration(heldout.metadata.get("action_noise", 0.0), ready.world.layout)
        report = value_report(ready, self.parameters, real, noise, derived_seed(self.seed, "check"))
        write_json(self.folder / REPORT, report.metrics())
        self.console.table("π0 in the grounded simulator", VALUE_TITLES, report.rows(), report.told)
        self._judge(report.problems, "Collect more data")
        return ready, {"grounding_acceptable": not report.problems}

    def _charged(self, scenario: Scenario) -> None:
        if not isinstance(scenario.grounding, NoGrounding):
            warn_uncharged(scenario.world, self.console, SIM, "the grounded action")

    def _chosen(self, scenario: Scenario, loaded: LoadedTransformation, validation: Batch) -> tuple[str, ...]:
        """Return the joints to ground, and tell them."""
        env = scenario.world.make()
        try:
            starts = places(validation.episodes, scenario.world.layout, REPLAYS)
        except KeyError as error:
            problem = f"needs {error.args[0]} in the real trajectories, to try joints out; name the joints"
            raise ConfigError("grounding.x", problem, given="auto") from error
        joints = fewest(env, loaded, starts, derived_seed(self.seed, "x"))
        env.close()
        self.console.status(f"grounding {len(joints)} of {len(loaded.forward.joints)} joints: {', '.join(joints)}")
        return joints

    def _judge(self, problems: Sequence[str], advice: str) -> None:
        if not problems:
            return
        problem = "; ".join(problems)
        if not self.accept:
            raise Refused(problem, advice)
        self.console.status(f"warning: {problem}")
