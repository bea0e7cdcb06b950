"""The audit of wiring: each kind of fault is named with its joints, and physics is never taken for one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from blind_arm import arm

from gsl.core.plant import Plant, nominal
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.log.records import slope
from gsl.diagnosis.wiring.audit import Audit, audit
from gsl.diagnosis.wiring.options import gain_grid, timings
from gsl.diagnosis.wiring.relation import relate
from gsl.policies.excitation import Excitation
from gsl.robots.nao import nao
from gsl_benchmarks.blind.jitter import NOISE, jitter
from gsl_benchmarks.blind.programmes import draw_programmes
from gsl_benchmarks.blind.same import play_same
from gsl_benchmarks.blind.wiring import KINDS, change, wire
from gsl_benchmarks.blind_wiring import draw_effect, record

pytestmark = pytest.mark.slow

PERIOD, STEP = 0.02, 0.002
MOTIONS = ("steps_small", "steps_large", "triangle_medium", "triangle_fast", "chirp")
PLAN = draw_programmes(
    Excitation(robot="blind_arm.arm", motions=MOTIONS, repeats=2, duration=3.5), 1, PERIOD, np.random.default_rng(0)
)[0]  # fmt: skip


def logged(commands: Sequence[np.ndarray] = PLAN.commands, effects: Mapping[str, Any] | None = None) -> Batch:
    """What one robot of the arm's make logs."""
    rng = np.random.default_rng(5)
    robot = jitter(nominal(arm()), rng)
    episodes = []
    played = play_same(robot, effects or {}, None, commands, [path[0] for path in commands], PERIOD)
    for asked, path in zip(commands, played, strict=True):
        position = path + 1.5e-3 * rng.standard_normal(path.shape)
        episodes.append(Trajectory(PERIOD * np.arange(len(path)), asked, position, slope(position, PERIOD)))
    names = [{"policy": name} for name in PLAN.names]
    return Batch(tuple(episodes), robot.robot.controlled, PERIOD, {"episodes": names})


def audited(log: Batch, plant: Plant | None = None) -> Audit:
    return audit(log, plant or nominal(arm()), STEP, lambda: None)


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_is_named_with_its_joints(kind: str) -> None:
    case = wire(kind, PLAN.commands, logged, nominal(arm()), np.random.default_rng(3))
    audit = audited(case.log, case.plant)
    assert audit.verdict == "wiring" and audit.spoils
    named = {
        joint for finding in audit.document()["findings"] if finding["kind"] == kind for joint in finding["joints"]
    }
    assert named == set(case.joints)


@pytest.mark.parametrize("kind", ["rate", "hold", "gains"])
def test_of_one_motion_alone_a_fault_that_physics_resembles_is_a_doubt(kind: str) -> None:
    """Friction of a real servo looks like one where a log shows no other motion: five of 17 motions of an SO-101."""
    case = wire(kind, PLAN.commands[:1], logged, nominal(arm()), np.random.default_rng(3))
    audit = audited(case.log, case.plant)
    assert audit.verdict in ("unclear", "clean") and not audit.spoils


def test_of_one_motion_alone_a_sign_is_a_fault() -> None:
    assert audited(change(logged(PLAN.commands[:1]), position=lambda x: x * [1.0, -1.0])).verdict == "wiring"


@pytest.mark.parametrize(
    "effects",
    [
        {}, {"zero_offset": {"offset": np.deg2rad(1.0), "joints": "elbow"}}, {"servo_gain": {"kp": 0.5}},
        {"servo_gain": {"kp": 0.35, "joints": "shoulder"}}, {"command_latency": {"delay": 0.013}},
        {"target_smoothing": {"time_constant": 0.04}}, {"deadband": {"width": 0.03}}, {"torque_limit": {"factor": 0.3}},
        {"coulomb_friction": {"torque": 0.3}}, {"viscous_friction": {"coefficient": 0.8}},
        {"armature": {"inertia": 0.03}},
        {"joint_limit": {"reduction": 0.17, "side": "both"}}, {"gravity_tilt": {"roll": 0.15}},
        {"quantisation": {"step": 0.01}},
    ],
    ids=lambda effects: "_".join(effects) or "nothing",
)  # fmt: skip
def test_physics_is_no_wiring(effects: Mapping[str, Any]) -> None:
    audit = audited(logged(effects=effects))
    assert (audit.verdict, audit.document()["findings"]) == ("clean", [])


@pytest.mark.parametrize("number", [64, 71])
def test_a_robot_that_is_hardly_off_has_no_other_rate(number: int) -> None:
    """Two of `gsl blind wiring seed=8`, 1.1 noise floors off: another rate took the place of physics."""
    plant, rng = nominal(nao()), np.random.default_rng([8, number])
    plan = draw_programmes(Excitation(robot="nao"), 1, PERIOD, np.random.default_rng(8))[0]
    effects, robot, noise = draw_effect(plant, rng), jitter(plant, rng), float(rng.uniform(*NOISE))
    log = record(robot, effects, plan, plan.commands, PERIOD, noise, np.random.default_rng(rng.integers(2**32)))
    assert audited(log, plant).verdict != "wiring"


def test_commands_that_are_nearly_equal_are_no_exchange() -> None:
    alike = [np.column_stack([path[:, 0], path[:, 0] + 0.01]) for path in PLAN.commands]
    log = logged(alike)
    assert (relate(log.episodes, PERIOD).source == [0, 1]).all()
    assert audited(log).verdict == "clean"


def test_a_row_late_is_as_well_a_latency_and_is_said_to_be() -> None:
    log = logged(effects={"command_latency": {"delay": PERIOD}})
    late = change(logged(), action=lambda x: np.vstack([x[1:], x[-1:]]))
    for logged_again in (log, late):
        audit = audited(logged_again)
        assert audit.verdict == "unclear" and not audit.spoils
        assert "latency of 20 ms" in audit.summary


@pytest.mark.parametrize("times", [10.0, 50.0])
def test_a_clock_that_runs_too_fast_is_told_by_speeds_that_no_joint_has(times: float) -> None:
    log = logged()
    hurried = tuple(replace(episode, time=episode.time / times) for episode in log.episodes)
    audit = audited(replace(log, episodes=hurried, control_period=PERIOD / times))
    fast = [finding for finding in audit.document()["findings"] if finding["kind"] == "speed"]
    assert audit.spoils and fast and {joint for finding in fast for joint in finding["joints"]} <= {*log.joints}
    assert fast[0]["row"] is not None and "times what the joint can do" in fast[0]["sentence"]


def test_two_faults_are_both_named() -> None:
    log = change(logged(), position=lambda x: x * [1.0, -1.0], action=lambda x: np.vstack([x[:1], x[:-1]]))
    assert {finding["kind"] for finding in audited(log).document()["findings"]} == {"sign", "shift"}


def test_the_order_of_the_joints_in_the_log_changes_nothing() -> None:
    log = change(logged(), position=lambda x: x * [1.0, -1.0])
    turned = log.only(tuple(reversed(log.joints)))
    assert [finding["joints"] for finding in audited(turned).document()["findings"]] == [["elbow"]]


def test_faults_of_one_search_have_keys_of_their_own() -> None:
    faults = [*timings(range(2), 100), *gain_grid(range(2), nominal(arm()))]
    assert len({fault.key for fault in faults}) == len(faults)
    assert faults[0].key == next(iter(timings(range(2), 100))).key != next(iter(timings([0], 100))).key
