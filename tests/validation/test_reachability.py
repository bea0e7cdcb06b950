"""Can the simulator do what the forward model predicts, and are policies still where the grounding has data?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gsl.core.history import History, find_rest_action
from gsl.core.region import INSIDE, region
from gsl.core.trajectory import Trajectory
from gsl.core.transitions import transitions
from gsl.grounding.gat import LoadedTransformation
from gsl.grounding.none import NoGrounding
from gsl.models.forward import ForwardModel
from gsl.models.inverse import Solver
from gsl.models.network import Network
from gsl.policies.walk_engine import WalkEngine
from gsl.rollout.rollout import Scenario, rollout
from gsl.tasks.walk import Walk
from gsl.validation.check import ask_reachability
from gsl.validation.drift import drifts
from gsl.validation.reachability import FLOOR, TOLERANCE, measure_misses, reachability
from gsl.validation.replay import places
from gsl.worlds.bullet import BulletWorld

SIM = BulletWorld(robot="nao", effects={}, settle=0.1)
POLICY = WalkEngine()
WALK = Scenario(SIM, Walk(duration=1.2), POLICY, "sim", NoGrounding())
JOINTS = SIM.layout.joints
KNEE = JOINTS.index("LKneePitch")


def predicts(bias: np.ndarray, rate: float = 0.05) -> LoadedTransformation:
    """A robot whose joints go a `rate` of the way to their targets in a tick, and by `bias` [rad] beyond."""
    n, history = len(JOINTS), History(0)
    weight = np.zeros((n, history.size(n)))
    weight[:, :n] = rate * np.eye(n)
    f = ForwardModel(Network([(weight, bias)]), history, JOINTS)
    return LoadedTransformation(f, Solver(f, rate * np.eye(n), 1e-9))


def _begun(walk: Trajectory, ticks: int) -> Trajectory:
    """The first ticks of a walk."""
    rows = {name: getattr(walk, name)[: ticks + 1] for name in ("time", "position", "velocity", "fell")}
    sensors = {name: column[: ticks + 1] for name, column in walk.sensors.items()}
    return replace(walk, action=walk.action[:ticks], grounded_action=None, reward=None, sensors=sensors, **rows)


def test_a_simulator_can_do_what_it_does_and_what_no_servo_can_is_told_joint_by_joint() -> None:
    env = WALK.make()
    walk = rollout(WALK, env, POLICY.initial, 1)
    env.close()
    starts, bare = places([walk], SIM.layout, 6), SIM.make()
    x = SIM.layout["position"]
    own = [place.seen[place.tick + 1][x] - place.seen[place.tick][x] for place in starts]
    missed = np.array([measure_misses(bare, place, change, 1) for place, change in zip(starts, own, strict=True)])
    jump = np.zeros(len(JOINTS))
    jump[KNEE] = 0.8
    impossible = reachability(bare, predicts(jump), starts, 1)
    bare.close()
    assert (missed < FLOOR + TOLERANCE * np.sqrt(np.mean(np.square(own), axis=0))).mean() > 0.97
    assert impossible.unreached[KNEE] == 1.0
    assert "most often in LKneePitch (100 %)" in impossible.sentence
    assert impossible.metrics()["by_joint"]["LKneePitch"] == 1.0


def test_a_long_past_is_asked_about_where_there_is_one() -> None:
    env = WALK.make()
    walk = rollout(WALK, env, POLICY.initial, 1)
    env.close()
    n, history = len(JOINTS), History(20)
    weight = np.zeros((n, history.size(n)))
    f = ForwardModel(Network([(weight, np.zeros(n))]), history, JOINTS)
    bare = SIM.make()
    report = ask_reachability(bare, LoadedTransformation(f, Solver(f, np.eye(n), 1e-9)), [walk], 1)
    none = ask_reachability(bare, LoadedTransformation(f, Solver(f, np.eye(n), 1e-9)), [_begun(walk, 25)], 1)
    bare.close()
    assert report is not None and report.steps == len(range(20, len(walk) - 9, 15)) and none is None


def test_joints_that_the_models_do_not_know_are_not_asked_about() -> None:
    env = WALK.make()
    walk = rollout(WALK, env, POLICY.initial, 1)
    env.close()
    starts, bare = places([walk], SIM.layout, 4), SIM.make()
    history, knees = History(0), ("LKneePitch", "RKneePitch")
    f = ForwardModel(Network([(np.zeros((2, history.size(2))), np.array([0.8, 0.0]))]), history, knees)
    report = reachability(bare, LoadedTransformation(f, Solver(f, np.eye(2), 0.1)), starts, 1)
    bare.close()
    assert report.joints == knees and report.unreached[0] == 1.0 > report.unreached[1]


def test_what_a_robot_was_told_at_rest_is_known_before_a_large_step_and_before_a_small_one() -> None:
    env = BulletWorld(robot="nao", effects={"servo_gain": {"kp": 0.5}}, floating=False, settle=0.5).make()
    posture = POLICY.posture(POLICY.initial, SIM.layout)
    seen, _ = env.reset(seed=1, options={"posture": posture})
    env.close()
    position = seen[SIM.layout["position"]]
    for step, off in ((1.0, 0.02), (0.15, 0.02), (0.01, 0.011)):
        assert np.abs(find_rest_action(posture - step, position) - posture).max() < off


def test_a_region_holds_its_own_kind_and_little_else() -> None:
    rng = np.random.default_rng(0)
    mix = rng.normal(size=(6, 6))

    def samples(count: int) -> np.ndarray:
        return rng.normal(size=(count, 6)) @ mix.T + 3.0

    ellipsoid = region(samples(2000), samples(2000))
    assert ellipsoid.outside(samples(4000)) == pytest.approx(1.0 - INSIDE, abs=0.006)
    assert ellipsoid.outside(samples(100) + 20.0) == 1.0
    still = region(samples(2000) * [0, 1, 1, 1, 1, 1], samples(2000) * [0, 1, 1, 1, 1, 1])
    assert still.outside(samples(4000) * [0, 1, 1, 1, 1, 1] + [1e-6, 0, 0, 0, 0, 0]) < 0.02


def test_a_policy_that_does_something_else_drifts_from_the_data() -> None:
    env = WALK.make()
    walks = [rollout(WALK, env, POLICY.initial, seed) for seed in range(4)]
    env.close()
    grounding = predicts(np.zeros(len(JOINTS)))
    history = grounding.forward.history
    seen, unseen = (transitions(part, history, 1, carried_out=False).windows for part in (walks[:3], walks[3:]))
    other = POLICY.initial + 2.0 * POLICY.scale * np.random.default_rng(1).standard_normal(len(POLICY.initial))
    still = replace(WALK, grounding=replace(grounding, alpha=0.0, noise=0.02))
    shares = drifts(still, region(seen, unseen), {"pi0": POLICY.initial, "other": other}, 7)
    assert shares["pi0"] < 0.1 < 0.5 < shares["other"]
