"""Grounding by torque noise: the world it makes, in shares of what a joint can give or in N·m, and its check."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import SMALL, done
from scenarios import QUIET
from scenarios import walk as plain_walk

from gsl.core.plant import Plant
from gsl.errors import ConfigError, Refused
from gsl.grounding.effects import DiagnosedEffects
from gsl.grounding.none import NoGrounding
from gsl.grounding.servo import LearnedServo
from gsl.grounding.torque_noise import TorqueNoise, torque_limits, with_torque_noise
from gsl.models.servo import neutral
from gsl.models.servo_members import ServoMembers
from gsl.policies.walk_engine import WalkEngine
from gsl.rollout.rollout import Scenario
from gsl.storage.models import write_model
from gsl.validation.check_grounding import check_grounding
from gsl.validation.gate import Gate
from gsl.worlds.bullet import BulletWorld

pytestmark = pytest.mark.slow

WORLD = BulletWorld(robot="nao", effects={"torque_limit": {"factor": 0.5, "joints": "arms"}})


def walk(grounding: Any, world: BulletWorld = WORLD) -> Scenario:
    """A walk with a grounding."""
    return replace(plain_walk(duration=2.0), world=world, grounding=grounding)


def noise(world: Any) -> np.ndarray:
    plant: Plant = world.plant
    return plant.torque_noise


def test_shares_are_of_what_each_joint_of_this_simulator_can_give() -> None:
    made = TorqueNoise(step=0.5, constant=0.1).switch_on(WORLD)
    np.testing.assert_allclose(noise(made), np.outer([0.5, 0.1], WORLD.plant.servo.limit))
    assert torque_limits(WORLD)["LShoulderPitch"] == pytest.approx(0.5 * 1.329)
    assert made.effects["torque_limit"] == [WORLD.effects["torque_limit"]]


def test_widths_are_in_newton_metres_by_scope_and_add_in_square_to_what_is_there() -> None:
    legs, arms = WORLD.plant.mask("legs"), WORLD.plant.mask("arms")
    made = with_torque_noise(WORLD, {"legs": 0.3}, {"legs": 0.1, "arms": 0.02})
    np.testing.assert_allclose(noise(made), [0.3 * legs, 0.1 * legs + 0.02 * arms])
    twice = with_torque_noise(made, 0.4, 0.0)
    np.testing.assert_allclose(noise(twice)[0], np.where(legs, 0.5, 0.4))
    assert with_torque_noise(WORLD, 0.0, 0.0) is WORLD


def test_noise_on_a_servo_is_what_motions_leave_unexplained_or_a_share_of_the_limit(tmp_path: Path) -> None:
    """Legs leave much unexplained, arms nothing; the least is a fifth of a limit, and 6 % of it constant."""
    model = neutral(WORLD.plant, np.random.default_rng(0))
    unexplained = np.where(WORLD.plant.mask("legs")[:, None], [1.5, 0.4], 0.0)
    write_model(tmp_path, ServoMembers((replace(model, noise=unexplained),)))
    made = LearnedServo(servo=str(tmp_path), torque_noise=1.0).shaken(replace(WORLD, servo=str(tmp_path)))
    least = np.outer([0.2, 0.06], WORLD.plant.servo.limit)
    np.testing.assert_allclose(noise(made), np.where(WORLD.plant.mask("legs"), [[1.5], [0.4]], least))
    assert LearnedServo(servo=str(tmp_path)).shaken(WORLD) is WORLD


def test_without_noise_an_episode_has_the_bits_it_had() -> None:
    scenario = walk(TorqueNoise(step=0.0, constant=0.0))
    assert scenario.prepare().world == WORLD and scenario.prepare().grounding == NoGrounding()


def test_on_top_of_effects_both_are_there(tmp_path: Path) -> None:
    late = {"command_latency": {"delay": 0.01}}
    scenario = walk(DiagnosedEffects(effects=late, inner=TorqueNoise(step=0.1, constant=0.05)))
    ready, report = check_grounding(scenario, Gate(WalkEngine().initial, tmp_path, QUIET, accept=False, seed=1))
    assert report["grounding_acceptable"] and report["effects"] == ["command_latency"]
    assert (ready.world.plant.servo.delay == 0.01).all() and (noise(ready.world) > 0.0).all()  # type: ignore[attr-defined]
    assert scenario.prepare(report) == ready


def test_noise_in_which_pi0_falls_is_refused(tmp_path: Path) -> None:
    gate = Gate(WalkEngine().initial, tmp_path, QUIET, accept=False, seed=1)
    with pytest.raises(Refused, match=r"π0 falls in \d of 4 episodes with torque noise.*Lower grounding.step"):
        check_grounding(walk(TorqueNoise(step=0.0, constant=1.0), WORLD), gate)
    assert not json.loads((tmp_path / "grounding.json").read_text())["acceptable"]
    gate = Gate(WalkEngine().initial, tmp_path, QUIET, accept=False, seed=1)
    _, report = check_grounding(walk(TorqueNoise(), WORLD), gate)
    assert report == {"grounding_acceptable": True}


def test_a_world_without_torques_is_refused_in_a_line() -> None:
    with pytest.raises(ConfigError, match="only Bullet worlds have torques"):
        TorqueNoise().switch_on(NoGrounding())
    with pytest.raises(ConfigError, match="not switched on"):
        TorqueNoise().start(WORLD.layout, np.random.default_rng(0))


def test_it_goes_through_a_search_and_an_iteration(tmp_path: Path) -> None:
    few = ("task.duration=1.2", "optimizer.generations=1", "optimizer.candidates=4")
    done("optimize", *SMALL, *few, "grounding=torque_noise", "name=one", folder=tmp_path)
    metrics = json.loads((tmp_path / "runs/one/optimize/metrics.json").read_text())
    assert metrics["grounding_acceptable"]
    late = ("real=nao_ideal", "real.effects.command_latency.delay=0.02")
    effects = "grounding.effects={command_latency:{delay:0.02}}"
    chosen = ("grounding=effects_torque_noise", effects, "name=two")
    said = done("iterate", *SMALL, *few, *late, *chosen, folder=tmp_path)
    assert "real data: " in said.out
    assert json.loads((tmp_path / "runs/two/iteration_01/optimize/metrics.json").read_text())["effects"]
