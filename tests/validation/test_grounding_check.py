from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from gsl.core.history import History
from gsl.core.trajectory import Batch, Trajectory
from gsl.errors import InputError
from gsl.grounding.gat import LoadedTransformation
from gsl.grounding.none import NoGrounding
from gsl.models.forward import ForwardModel
from gsl.models.free_run import TICKS
from gsl.models.inverse import Solver
from gsl.models.network import Network
from gsl.policies.walk_engine import WalkEngine
from gsl.rollout.rollout import Scenario, rollout
from gsl.tasks.walk import Walk
from gsl.validation.check import ALPHAS, check, count_allowed_falls, largest_stable
from gsl.validation.replay import PAST, Deviations, Place, places, replay
from gsl.validation.report import BARE, GROUNDED, OFF, PI0, STILL, GroundingReport
from gsl.worlds.bullet import BulletWorld

POLICY = WalkEngine()
SCENARIO = Scenario(
    BulletWorld(robot="nao", effects={}, start_noise=0.02), Walk(duration=1.0), POLICY, "sim", NoGrounding()
)
JOINTS = SCENARIO.world.layout.joints


@cache
def heldout() -> Batch:
    env = SCENARIO.make()
    parameters = [POLICY.initial, 0.97 * POLICY.initial]
    episodes = tuple(rollout(SCENARIO, env, theta, seed) for seed, theta in enumerate(parameters))
    return Batch(episodes, JOINTS, 0.02, {"episodes": [{"policy": "pi0"}, {"policy": "neighbour_01"}]})


def a_transformation(push: float) -> LoadedTransformation:
    """Every joint is sent `push` [rad] beyond the agent's action."""
    size, n = History(0).size(len(JOINTS)), len(JOINTS)
    models = [
        ForwardModel(Network([(np.zeros((n, size)), np.full(n, value))]), History(0), JOINTS) for value in (push, 0.0)
    ]
    return LoadedTransformation(models[0], Solver(models[1], np.eye(n), 1e-9))


GROUNDED_SCENARIO = replace(SCENARIO, grounding=a_transformation(0.0))


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_grounding_that_does_nothing_replays_as_no_grounding_whatever_noise_is_on_top(noise: float) -> None:
    grounding = replace(a_transformation(0.0), noise=noise)
    report = check(replace(SCENARIO, grounding=grounding), POLICY.initial, heldout(), 1)
    assert report.deviations.keys() == {PI0, OFF}
    for simulators in report.deviations.values():
        for ticks in (1, TICKS):
            np.testing.assert_array_equal(simulators[GROUNDED][ticks].joints, simulators[BARE][ticks].joints)
    errors = report.metrics()["errors"][OFF]
    assert errors[BARE]["10_ticks"]["joints_deg"] < 0.5 * errors[STILL]["10_ticks"]["joints_deg"]
    assert report.acceptable
    assert report.metrics()["pi0"]["falls"] == 0


def test_what_is_expected_has_neither_noise_nor_draws() -> None:
    grounding = replace(a_transformation(0.2), alpha=0.5)
    assert replace(grounding, noise=0.1, draws=True).deterministic == grounding


class Watching:
    """A grounding that changes nothing and remembers what it has seen."""

    def __init__(self, span: int) -> None:
        self.span, self.seen = span, list[np.ndarray]()

    def start(self, layout: Any, rng: Any) -> Watching:
        return self

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        self.seen.append(observation)
        return action


@pytest.mark.parametrize("span", [3, 9])
def test_a_replay_begins_with_all_the_ticks_at_which_a_model_looks(span: int) -> None:
    grounding, n, size = a_transformation(0.0), len(JOINTS), History(span).size(len(JOINTS))
    looks_back = ForwardModel(Network([(np.zeros((n, size)), np.zeros(n))]), History(span), JOINTS)
    assert replace(grounding, forward=looks_back).span == span
    env = SCENARIO.world.make()
    for place in places(heldout().episodes, env.layout, 2):
        watching = Watching(span)
        next(replay(env, watching, place, np.random.default_rng(1), 1))
        first = max(0, place.tick - max(PAST, span))
        np.testing.assert_array_equal(watching.seen[:-1], place.seen[first : place.tick])


def test_a_grounding_that_makes_things_worse_is_not_acceptable_and_says_why() -> None:
    report = check(replace(SCENARIO, grounding=a_transformation(0.3)), POLICY.initial, heldout(), 1)
    assert not report.acceptable
    assert "off π0 are farther from the real ones" in report.problems[0]


def test_alpha_stays_at_one_where_nothing_falls_and_sinks_where_all_falls() -> None:
    for push, largest in ((0.0, True), (3.0, False)):
        tried = {alpha: replace(SCENARIO, grounding=replace(a_transformation(push), alpha=alpha)) for alpha in ALPHAS}
        assert (largest_stable(tried, POLICY.initial, 1) == max(ALPHAS)) == largest


@pytest.mark.parametrize(
    ("group", "lacking"),
    [
        ("base", ("base.position", "base.orientation", "base.velocity")),
        ("base.velocity.z", ("base.velocity",)),
        ("gyro", ("gyro",)),
    ],
)
def test_where_nobody_knows_the_base_only_the_falls_of_pi0_are_checked(group: str, lacking: tuple[str, ...]) -> None:
    report = check(GROUNDED_SCENARIO, POLICY.initial, _without(group), 1)
    assert (report.deviations, report.reach, report.problems, report.rows()) == ({}, None, (), [])
    assert report.metrics()["pi0"]["falls"] == 0 and report.lacking == lacking


def test_a_neighbour_that_was_cut_short_is_told_as_the_reason() -> None:
    pi0, other = heldout().episodes
    down = np.zeros(11, dtype=bool)
    down[-1] = True
    short = replace(_first(other, 10), fell=down)
    report = check(GROUNDED_SCENARIO, POLICY.initial, replace(heldout(), episodes=(pi0, short)), 1)
    assert "held out, but fallen or stopped too early: 1; collect neighbours" in report.problems[0]


def _first(episode: Trajectory, steps: int) -> Trajectory:
    rows = {name: getattr(episode, name)[: steps + 1] for name in ("time", "position", "velocity")}
    sensors = {name: values[: steps + 1] for name, values in episode.sensors.items()}
    reward = None if episode.reward is None else episode.reward[:steps]
    return replace(episode, action=episode.action[:steps], **rows, sensors=sensors, reward=reward)


def _without(group: str) -> Batch:
    episodes = [
        replace(
            episode, sensors={name: values for name, values in episode.sensors.items() if not name.startswith(group)}
        )
        for episode in heldout().episodes
    ]
    return replace(heldout(), episodes=tuple(episodes))


def test_a_body_that_is_farther_is_remarked_on_whatever_its_joints_are() -> None:
    def apart(joints: float, pitch: float, forward: float) -> dict[int, Deviations]:
        deviations = Deviations(np.full((3, 2), joints), np.full(3, pitch), np.full(3, forward))
        return dict.fromkeys((1, TICKS), deviations)

    def report(joints: float, pitch: float, forward: float) -> GroundingReport:
        sims = {GROUNDED: apart(joints, pitch, forward), BARE: apart(0.1, 0.1, 0.1)}
        return GroundingReport({OFF: sims}, ("a", "b"), 1, 0, np.zeros(1))

    remark = "after 10 ticks the body's {} off π0 is farther from the real one"
    assert report(0.05, 0.2, 0.2).remark == report(0.2, 0.2, 0.2).remark == remark.format("pitch and place")
    assert report(0.05, 0.05, 0.2).remark == remark.format("place")
    assert report(0.05, 0.05, 0.05).remark == report(0.2, 0.1, 0.1).remark == ""


def test_trajectories_of_another_robot_are_refused() -> None:
    with pytest.raises(InputError, match="differ in joints: their order"):
        check(GROUNDED_SCENARIO, POLICY.initial, replace(heldout(), joints=JOINTS[::-1]), 1)


@pytest.mark.parametrize(("share", "allowed"), [(0.0, 0), (0.1, 2), (0.6, 4), (1.0, 4)])
def test_pi0_may_fall_as_it_does_in_real(share: float, allowed: int) -> None:
    heldout = Batch((), ("a",), 0.02, {"pi0_falls": share})
    assert count_allowed_falls(heldout) == allowed


def test_a_robot_without_feet_is_replayed() -> None:
    env = BulletWorld(robot="so101", effects={}, floating=False, start_noise=0.0).make()
    n, position = len(env.layout.joints), env.layout["position"]
    seen, sent = [env.reset(seed=1)[0]], [np.full(n, 0.1 * np.sin(0.3 * tick)) for tick in range(20)]
    for action in sent:
        seen.append(env.step(action)[0])
    place = Place(np.array(seen), np.array(sent), PAST)
    ends = list(replay(env, NoGrounding(), place, np.random.default_rng(0), 5))
    env.close()
    np.testing.assert_allclose(ends[-1][position], seen[PAST + 5][position], atol=2e-3)
