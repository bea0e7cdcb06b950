"""Loads on single joints: closed forms of stiffness and strength, and what groundings hand over."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from bodies import held
from scenarios import QUIET

from gsl.core.body import lump
from gsl.core.dynamics import gravity_torque, mass_matrix
from gsl.core.grounding import gain
from gsl.core.history import History, windows
from gsl.core.layout import Layout
from gsl.core.plant import Plant
from gsl.errors import ConfigError
from gsl.grounding.ane import ActionNoise
from gsl.grounding.gat import LoadedTransformation
from gsl.grounding.none import NoGrounding
from gsl.models.forward import ForwardModel
from gsl.models.inverse import Solver
from gsl.models.network import Network
from gsl.validation.compliance import AMPLITUDE, FREQUENCY, MOST, Compliance, measure, rounds, stance
from gsl.validation.compliance_transfer import (
    SECTION,
    ComplianceReport,
    compute_transfers,
    report_compliance,
    with_real,
)
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.held import Held
from gsl.worlds.servo import BRISTLE

pytestmark = pytest.mark.slow

OMEGA = 2.0 * np.pi * FREQUENCY
SOFT = {"servo_gain": {"kp": 0.5, "kd": 0.4}}
WEAK = {"torque_limit": {"factor": 0.75}}
HISTORY = History(3)
EFFORT = np.array([held().plant.robot.joint(name).effort for name in held().plant.robot.motors])


@cache
def bare(effects: str = "{}") -> Compliance:
    return measure(held(json.loads(effects)), NoGrounding(), 1)


def of(effects: dict) -> Compliance:
    return bare(json.dumps(effects))


def closed_form(plant: Plant) -> np.ndarray:
    """Impedance at each motor of PD servos on a tree of rigid bodies in the stance, from the textbook's matrices."""
    robot, servo, angles = lump(plant.robot), plant.servo, stance(plant.robot)[plant.robot.drive]

    def weight(at: np.ndarray) -> np.ndarray:
        return gravity_torque(robot, dict(zip(robot.motors, at, strict=True)), plant.gravity)

    bumps = 1e-5 * np.eye(len(angles))
    gravity = np.array([(weight(angles + bump) - weight(angles - bump)) / 2e-5 for bump in bumps]).T
    mass = mass_matrix(robot, dict(zip(robot.motors, angles, strict=True)))[6:, 6:] + np.diag(servo.armature)
    whole = np.diag(servo.kp + 1j * OMEGA * servo.kd) + gravity - OMEGA**2 * mass
    return 1.0 / np.diag(np.linalg.inv(whole))


@pytest.mark.parametrize("effects", [{}, SOFT])
def test_a_pd_servo_is_as_stiff_as_its_gain_and_its_body_say(effects: dict) -> None:
    """Stiffness to 1 %; light links with heavy rotors (rotor.py) answer up to 3 steps late, which costs damping."""
    expected, compliance = closed_form(held(effects).plant), of(effects)
    np.testing.assert_allclose(compliance.stiffness, expected.real, rtol=0.01)
    late = (expected.imag / OMEGA - compliance.damping) / held(effects).plant.servo.kp  # [s]
    assert (late > -1e-4).all() and (late < 3.3 * held().step).all()
    assert (late[compliance.where("arms")] < 0.3 * held().step).all()


def test_dry_friction_adds_the_describing_function_of_a_bristle_that_slips() -> None:
    """F / z (p - sin p cos p) / pi, cos p = 1 - 2 z / Q, and 4 F (Q - z) / pi Q² at amplitude Q."""
    friction = 0.2
    rubbing, plain = of({"coulomb_friction": {"torque": friction, "joints": "legs"}}), of({})
    legs = rubbing.where("legs")
    moved = (AMPLITUDE * EFFORT / np.abs(rubbing.impedance))[legs]
    part = np.arccos(1.0 - 2.0 * BRISTLE / moved)
    spring = friction / BRISTLE * (part - np.sin(part) * np.cos(part)) / np.pi
    lost = 4.0 * friction * (moved - BRISTLE) / (np.pi * moved**2)
    more = (rubbing.impedance - plain.impedance)[legs]
    np.testing.assert_allclose(more.real, spring, rtol=0.1)
    np.testing.assert_allclose(more.imag, lost, rtol=0.06)
    np.testing.assert_allclose(rubbing.stiffness[~legs], plain.stiffness[~legs])


def test_a_joint_gives_way_where_its_torque_limit_and_its_weight_say() -> None:
    robot = lump(held().plant.robot)
    angles = dict(zip(robot.motors, stance(robot)[robot.drive], strict=True))
    weight = np.abs(gravity_torque(robot, angles, held().plant.gravity))
    assert (
        np.abs(of({}).torque - EFFORT) < weight + 0.08 * EFFORT
    ).all()  # the weight at 0.1 rad beyond is a little more
    np.testing.assert_allclose(of({}).torque - of(WEAK).torque, 0.25 * EFFORT, rtol=0.03)


def test_a_joint_that_does_not_give_way_has_the_greatest_load() -> None:
    np.testing.assert_array_equal(of({"torque_limit": {"factor": 2.0}}).torque, MOST * EFFORT)


def test_without_grounding_nothing_is_handed_over_and_with_the_true_effects_everything() -> None:
    real = {**SOFT, **WEAK}
    for share in compute_transfers(of({}), of({}), of(real)).values():
        assert share == pytest.approx((0.0, 0.0, 0.0))
    for share in compute_transfers(of({}), of(real), of(real)).values():
        assert share == pytest.approx((1.0, 1.0, 1.0))


def test_where_simulator_and_robot_do_not_differ_there_is_no_share() -> None:
    for share in compute_transfers(of({}), of({}), of(WEAK)).values():
        assert share.stiffness is None and share.impedance is None and share.torque == pytest.approx(0.0)
    assert "legs: stiffness no difference, strength 0.00" in ComplianceReport(of({}), of({}), of(WEAK)).sentence


def test_a_grounding_that_softens_joints_which_are_as_stiff_as_the_robots_is_told() -> None:
    sentence = ComplianceReport(of({}), of(SOFT), of({})).sentence
    assert "legs: stiffness no difference, yet the grounding changes it by -50 %" in sentence


def motions(seed: int, count: int) -> list[np.ndarray]:
    """Actions of all joints around the stance, each a sum of sines, shape (200, n_joints)."""
    at, rng, time = stance(held().plant.robot), np.random.default_rng(seed), 0.02 * np.arange(200)[:, None]
    paths = []
    for _ in range(count):
        turn, phase = 2.0 * np.pi * rng.uniform(0.3, 2.5, (3, 1, len(at))), rng.uniform(0, 6, (3, 1, len(at)))
        size = rng.uniform(0.02, 0.08, (3, 1, len(at)))
        paths.append(at + (size * (np.sin(turn * time + phase) - np.sin(phase))).sum(axis=0))
    return paths


def a_forward_model(effects: dict) -> tuple[ForwardModel, float]:
    """A linear law of each joint's own window, fitted to motions in the air, and the share it leaves unexplained."""
    world, paths = held(effects), motions(3, 6)
    robot, ticks = world.plant.robot, np.arange(HISTORY.span, 200)
    n, rest = len(robot.controlled), stance(robot)[robot.drive]
    logs = Held.of(world.plant, world.step, world.period).play([path[:, robot.drive] for path in paths], [rest] * 6, 25)
    x = [log[:, :n] for log in logs]
    inputs = np.vstack([windows(HISTORY, q, a, np.zeros((len(q), 0)), ticks) for q, a in zip(x, paths, strict=True)])
    changes = np.vstack([q[ticks + 1] - q[ticks] for q in x])
    weight, offset = np.zeros((n, HISTORY.size(n))), np.zeros(n)
    for joint in range(n):
        own = np.arange(joint, HISTORY.size(n), n)
        rows = np.c_[inputs[:, own], np.ones(len(inputs))]
        law = np.linalg.lstsq(rows, changes[:, joint], rcond=1e-9)[0]
        weight[joint, own], offset[joint] = law[:-1], law[-1]
    network = Network([(weight, offset)])
    left = np.var(changes - network.predict_many(inputs)) / np.var(changes)
    return ForwardModel(network, HISTORY, robot.controlled), float(left)


def test_models_that_know_how_joints_move_hand_over_little_of_how_they_yield() -> None:
    """GAT by hand: f of a soft, late robot, and the simulator's inverse that solves with f_sim."""
    real = {**SOFT, "command_latency": {"delay": 0.03}}
    (forward, left), (simulator, left_of_simulator) = a_forward_model(real), a_forward_model({})
    assert max(left, left_of_simulator) < 1e-3
    by_action = simulator.network.layers[0][0][:, : len(simulator.joints)]
    grounding = LoadedTransformation(forward, Solver(simulator, gain(by_action, 0.2), 0.2))
    compliance = measure(held(), grounding, 1)
    for share in compute_transfers(of({}), compliance, of(real)).values():
        assert share.stiffness is not None and -0.2 < share.stiffness < 0.3
        assert share.impedance is not None and share.impedance < 0.3
    assert (np.abs(compliance.torque - of({}).torque) < 0.05 * EFFORT).all()


class Softer:
    """A user's own grounding: the servo sees a share of its error."""

    def __init__(self, share: float) -> None:
        self.share = share

    def start(self, layout: Layout, rng: np.random.Generator) -> "Softer":
        self.position = layout["position"]
        return self

    def transform(self, observation: np.ndarray, action: np.ndarray) -> np.ndarray:
        here = observation[self.position]
        return here + self.share * (action - here)


def test_a_users_own_grounding_is_measured_as_it_acts() -> None:
    """Held for a tick T, a' = q + c (a - q) has K = c kp and a damping of kd - (1 - c) kp T / 2 or more (torque.md)."""
    world = replace(held(), period=0.004)
    compliance = measure(world, Softer(0.5), 1)
    seen = np.array([name in world.plant.robot.controlled for name in compliance.motors])
    np.testing.assert_allclose(
        compliance.stiffness[seen], of({}).stiffness[seen] - 0.5 * world.plant.servo.kp[seen], rtol=0.04
    )
    np.testing.assert_allclose(
        compliance.stiffness[~seen], of({}).stiffness[~seen], rtol=0.01
    )  # its command has no eyes


def test_one_branch_does_not_feel_a_load_on_another() -> None:
    robot = held().plant.robot
    loaded = rounds(robot)
    np.testing.assert_array_equal(np.sum(loaded, axis=0), 1)
    compliance = measure(held(), Softer(1.0), 1)  # one joint at a time
    np.testing.assert_allclose(compliance.stiffness, of({}).stiffness, rtol=1e-6)
    np.testing.assert_allclose(compliance.torque, of({}).torque, rtol=1e-3)


PENDULUM = BulletWorld(robot="pendulum", effects={}, floating=False, step=0.001, period=0.005)


def test_a_robot_without_groups_is_one_group() -> None:
    compliance = measure(PENDULUM, NoGrounding(), 1)
    assert list(compliance.groups) == ["all"]
    assert compliance.stiffness[0] == pytest.approx(closed_form(PENDULUM.plant)[0].real, rel=0.02)


def test_noise_is_told_and_the_seed_decides() -> None:
    plain = measure(PENDULUM, NoGrounding(), 1)
    first, again, other = (measure(PENDULUM, ActionNoise(sd=0.05), seed) for seed in (5, 5, 6))
    assert first.stiffness == again.stiffness != other.stiffness
    assert first.noise > 2.0 * plain.noise
    assert abs(first.stiffness - plain.stiffness) < 5.0 * first.noise


def test_a_world_that_is_no_robot_is_refused() -> None:
    with pytest.raises(ConfigError, match="Bullet"):
        measure(object(), NoGrounding(), 1)


def test_the_report_of_a_search_gains_a_section_and_the_real_robot_beside_it_shares(tmp_path: Path) -> None:
    report, real = tmp_path / "grounding.json", held(SOFT)
    report.write_text('{"acceptable": true}')
    metrics = report_compliance(held(), real, NoGrounding(), report, QUIET, 1)
    document = json.loads(report.read_text())
    assert document["acceptable"] and set(document[SECTION]["groups"]) == {"legs", "arms"}
    legs = metrics[SECTION]["legs"]["stiffness"]
    assert legs["grounded"] < 0.6 * legs["sim"]
    beside = with_real(report, real, 1)
    assert beside is not None and beside.metrics()["legs"]["share"]["stiffness"] == pytest.approx(1.0)
    assert "legs: stiffness 1.00" in beside.sentence and len(beside.rows()) == 6


def test_what_changes_nothing_or_cannot_be_loaded_has_no_section(tmp_path: Path) -> None:
    report = tmp_path / "grounding.json"
    assert report_compliance(held(), held(), NoGrounding(), report, QUIET, 1) == {}
    assert not report.exists() and with_real(report, held(), 1) is None


def test_a_document_returns_what_was_measured() -> None:
    compliance = Compliance.of(json.loads(json.dumps(of({}).document())))
    np.testing.assert_array_equal(compliance.stiffness, of({}).stiffness)
    assert compliance.groups == of({}).groups
    rows = ComplianceReport(compliance, compliance).rows()
    assert [row[0] for row in rows] == ["legs"] * 3 + ["arms"] * 3
