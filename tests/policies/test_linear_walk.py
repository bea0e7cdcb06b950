"""The linear walk: sides that mirror each other, a π0 that does not progress, a value at the end alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import yaml

from gsl.core.configuration import configuration_folder
from gsl.core.layout import Layout
from gsl.errors import ConfigError
from gsl.grounding.none import NoGrounding
from gsl.policies.linear_walk import LinearWalk
from gsl.rollout.rollout import Scenario, rollout
from gsl.tasks.distance import Distance
from gsl.worlds.bullet import BulletWorld

JOINTS = ("LHipRoll", "LKneePitch", "RHipRoll", "RKneePitch", "LHipYawPitch")
LAYOUT = Layout(JOINTS, {"position": 5, "velocity": 5, "gyro": 3, "base.position": 3}, 0.02)
PAIRS: dict[str, Any] = {"LHipYawPitch": None, "LHipRoll": ("RHipRoll", -1.0), "LKneePitch": ("RKneePitch", 1.0)}
POLICY = LinearWalk(pairs=PAIRS, stance={"LKneePitch": 0.9, "LHipRoll": 0.1}, stepping={"LKneePitch": 0.2})


def acted(parameters: np.ndarray, gyro: tuple[float, float], tick: int) -> dict[str, float]:
    run, seen = POLICY.start(parameters, LAYOUT), np.zeros(LAYOUT.size)
    seen[LAYOUT["gyro"]] = (*gyro, 7.0)
    for _ in range(tick + 1):
        action = run.act(seen)
    return dict(zip(JOINTS, action, strict=True))


def test_three_weights_and_an_offset_a_joint_and_a_frequency() -> None:
    assert len(POLICY.names) == 4 * 3 + 1 == len(POLICY.initial) == len(POLICY.scale)


def test_left_follows_gyroscope_and_sine_and_right_is_its_reflection_in_the_mirror() -> None:
    theta = POLICY.initial + 0.1 * np.arange(len(POLICY.initial)) * POLICY.scale
    named = dict(zip(POLICY.names, theta, strict=True))
    action = acted(theta, (0.3, -0.4), tick=5)
    sine = np.sin(named["frequency"] * 5 * 0.02)
    for joint, pair in PAIRS.items():
        swing = 0.3 * named[f"{joint}_from_gyro_x"] - 0.4 * named[f"{joint}_from_gyro_y"]
        swing += sine * named[f"{joint}_from_sine"]
        offset = named[f"{joint}_offset"]
        assert action[joint] == pytest.approx(offset + swing)
        if pair:
            assert action[pair[0]] == pytest.approx(pair[1] * (offset - swing))


def test_a_joint_that_the_world_lacks_is_named() -> None:
    wrong = replace(POLICY, pairs={"LKneePitch": ("RKnePitch", 1.0)})
    with pytest.raises(ConfigError, match="did you mean RKneePitch"):
        wrong.start(wrong.initial, LAYOUT)


def test_distance_is_paid_at_the_end_and_a_fall_costs_what_it_should() -> None:
    seen = [np.zeros(LAYOUT.size) for _ in range(4)]
    for tick, observation in enumerate(seen):
        observation[LAYOUT["base.position"].start] = 1.0 + 0.1 * tick
    task = Distance(duration=0.06)

    def values(role: str, fall_at: int) -> list[float]:
        run = task.start(LAYOUT, seen[0], role)
        return [run.step(seen[k], seen[k + 1], k == fall_at).reward for k in range(min(3, fall_at + 1))]

    assert values("sim", 9) == pytest.approx([0.0, 0.0, 0.3])
    assert values("real", 1) == [0.0, 0.0]
    assert values("sim", 1) == pytest.approx([0.0, 0.2 - 0.25])


def test_the_papers_policy_has_33_parameters_and_its_first_one_stays_where_it_is() -> None:
    config = yaml.safe_load((configuration_folder() / "policy/linear_walk.yaml").read_text())
    policy = LinearWalk(**{key: value for key, value in config.items() if key != "_target_"})
    assert len(policy.names) == 33
    scenario = Scenario(BulletWorld(robot="nao", effects={}), Distance(), policy, "real", NoGrounding())
    env = scenario.make()
    walked = rollout(scenario, env, policy.initial, 1)
    env.close()
    assert not walked.ended_in_a_fall
    assert abs(walked.value) < 0.01
