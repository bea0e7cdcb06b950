"""Diagnosed effects as a grounding: the world that they make is the world that has them, whatever else is inside."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from commands import SMALL, done, gsl
from scenarios import AIR, QUIET, REACH, arm, walk

from gsl.core.layout import Layout
from gsl.core.trajectory import Trajectory
from gsl.effects.effect import together
from gsl.errors import ConfigError, GslError
from gsl.grounding.ane import ActionNoise
from gsl.grounding.diagnosis_file import Diagnosis
from gsl.grounding.effects import DiagnosedEffects, innermost, switch_on
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.none import NoGrounding
from gsl.grounding.preparation import parents_of
from gsl.grounding.randomised import RandomisedEffects
from gsl.rollout.rollout import Scenario, rollout
from gsl.storage.policies import read_policies
from gsl.validation.check_grounding import check_grounding
from gsl.validation.effects import check_effects
from gsl.validation.gate import Gate

pytestmark = pytest.mark.slow

LATE = {"command_latency": {"delay": 0.02}}
DRY = {"coulomb_friction": [{"torque": 0.1, "joints": "legs"}, {"torque": 0.05, "joints": "arms"}]}
PAIRS = {"without an effect": {}, "one": LATE, "several": {**LATE, **DRY}}


def found(effects: Mapping[str, Any], **settings: Any) -> Diagnosis:
    return Diagnosis("causes", tuple(effects), "told", "nao", settings.pop("simulated", {}), effects, **settings)


def passed(scenario: Scenario, folder: Path, *, accept: bool = False) -> tuple[Scenario, Mapping[str, Any]]:
    return check_grounding(scenario, Gate(REACH.initial, folder, QUIET, accept, 1))


def ran(scenario: Scenario, seed: int = 3) -> Trajectory:
    env = scenario.make()
    try:
        return rollout(scenario, env, scenario.policy.initial, seed)
    finally:
        env.close()


@pytest.mark.parametrize("effects", PAIRS.values(), ids=PAIRS.keys())
def test_a_simulator_with_what_it_lacks_is_the_real_world(effects: Mapping[str, Any]) -> None:
    real = replace(AIR, effects=effects)
    mended = switch_on(AIR, found(effects))
    first, second = (ran(replace(arm(), world=world)) for world in (mended, real))
    np.testing.assert_array_equal(first.position, second.position)


def test_effects_add_up_to_those_of_the_simulator() -> None:
    worn = replace(AIR, effects=DRY)
    mended = switch_on(worn, found(LATE, simulated=DRY))
    for name, value in replace(AIR, effects={**DRY, **LATE}).plant.servo._asdict().items():
        np.testing.assert_array_equal(getattr(mended.plant.servo, name), value)  # type: ignore[attr-defined]
    assert together([DRY, LATE, DRY])["coulomb_friction"] == [*DRY["coulomb_friction"]] * 2


def test_a_diagnosis_of_another_simulator_is_refused() -> None:
    with pytest.raises(ConfigError, match="of another simulator: the nao with no effects; take this one"):
        switch_on(replace(AIR, effects=DRY), found(LATE))
    with pytest.raises(ConfigError, match="of another simulator"):
        switch_on(AIR, replace(found(LATE), robot="pepper"))


def test_a_grounding_without_diagnosis_or_before_its_effects_are_on_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"grounding\.diagnosis: is missing"):
        DiagnosedEffects().load(lambda reference, method: found(LATE))
    with pytest.raises(ConfigError, match="not switched on"):
        DiagnosedEffects(effects=LATE).start(Layout((), {}, 0.02), np.random.default_rng())


def test_given_effects_need_no_diagnosis_and_win_over_one() -> None:
    diagnosis = DiagnosedEffects(diagnosis="x", effects=LATE).load(lambda reference, method: found(DRY))
    assert (diagnosis.verdict, diagnosis.effects, diagnosis.causes) == ("given", LATE, ("command_latency",))


def test_the_inner_grounding_acts_in_the_diagnosed_world(tmp_path: Path) -> None:
    grounding = DiagnosedEffects(effects=LATE, inner=ActionNoise(sd=0.01))
    ready, about = passed(replace(arm(), grounding=grounding), tmp_path)
    noisy = replace(arm(), world=replace(AIR, effects=LATE), grounding=ActionNoise(sd=0.01))
    np.testing.assert_array_equal(ran(ready).position, ran(noisy).position)
    assert innermost(grounding) == ready.grounding
    assert about == {"effects": ["command_latency"], "diagnosis": "given", "grounding_acceptable": True}


def test_what_a_grounding_is_made_of_is_named_from_the_outside_in(chain: Path) -> None:
    folder = chain / "runs/chain"
    models = {"forward_model": str(folder / "train_forward"), "inverse_model": str(folder / "train_inverse")}
    nested = DiagnosedEffects(effects=LATE, inner=ActionTransformation(**models))
    roles = parents_of(nested)
    assert list(roles) == ["grounding.inner.forward_model", "grounding.inner.inverse_model"]


def test_effects_with_which_nobody_can_stand_are_refused(tmp_path: Path) -> None:
    weak = DiagnosedEffects(effects={"torque_limit": {"factor": 0.05}})
    scenario = replace(walk(duration=2.0), grounding=weak)
    gate = Gate(scenario.policy.initial, tmp_path, QUIET, False, 1)
    with pytest.raises(GslError, match=r"refused: π0 falls in 4 of 4 episodes.*accept=true"):
        check_grounding(scenario, gate)
    _, about = check_grounding(scenario, replace(gate, accept=True))
    assert about["grounding_acceptable"] is False
    assert json.loads((tmp_path / "grounding.json").read_text())["pi0"]["falls"] == 4


def test_effects_around_drawn_ones_are_checked_too(tmp_path: Path) -> None:
    grounding = DiagnosedEffects(effects=LATE, inner=RandomisedEffects(("link_mass",), width=0.1))
    _, about = passed(replace(arm(), grounding=grounding), tmp_path)
    assert about["width"] == 0.1 and about["grounding_acceptable"]
    assert json.loads((tmp_path / "grounding.json").read_text())["effects"] == LATE


def test_effects_that_take_the_held_out_gap_nowhere_are_a_problem() -> None:
    checked = check_effects(found(LATE, before=3.0, after=3.1), arm(), REACH.initial, 1)
    assert checked["problems"] == ["held out, the gap is 3.1 noise floors with the effects, 3.0 without"]
    assert check_effects(found(LATE, before=3.0, after=1.1), arm(), REACH.initial, 1)["acceptable"]


def test_without_a_cause_the_simulator_is_only_calibrated() -> None:
    clean, unknown = (Diagnosis(verdict, (), "", "nao", {}, {}).sentence for verdict in ("no_gap", "unknown"))
    assert clean.endswith("calibrated joint by joint.")
    assert unknown == f"{clean} In the task that may be no nearer: compare with grounding=ane and grounding=gat."
    assert found(LATE).sentence == "Switched on in the simulator: command_latency."


def test_optimising_with_an_effect_as_grounding_is_optimising_in_the_world_that_has_it(tmp_path: Path) -> None:
    line = ("optimize", *SMALL, "task.duration=1.0", "optimizer.generations=1")
    effect = "effects.command_latency.delay=0.02"
    done(*line, "name=a", "grounding=effects", f"grounding.{effect}", folder=tmp_path)
    done(*line, "name=b", "grounding=none", f"world.{effect}", folder=tmp_path)
    first, second = (read_policies(tmp_path / f"runs/{name}/optimize/policies.json") for name in "ab")
    assert first.records == second.records


def test_a_grounding_names_what_is_missing(tmp_path: Path) -> None:
    said = gsl("optimize", *SMALL, "name=x", "grounding=effects", folder=tmp_path)
    nothing = "gsl optimize: x/diagnose: there is no such path and no such run in runs"
    assert (said.code, said.lines) == (2, [f"{nothing}; grounding.diagnosis=RUN takes another run's"])
    assert gsl("optimize", *SMALL, "name=x", "grounding=effects", "grounding.diagnosis=y", folder=tmp_path).lines == [
        nothing.replace("x/diagnose", "y")
    ]


def test_effects_and_a_transformation_are_one_choice() -> None:
    conf = Path(__file__).parents[2] / "conf/grounding/effects_gat.yaml"
    assert yaml.safe_load(conf.read_text())["defaults"] == ["effects", "gat_residual@inner", "_self_"]
    assert innermost(DiagnosedEffects(effects=LATE, inner=DiagnosedEffects(effects=DRY))) == NoGrounding()
