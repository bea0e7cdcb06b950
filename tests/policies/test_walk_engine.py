"""The walk engine in the ideal world and by itself."""

import numpy as np
import pytest
from bodies import walked, world
from scipy.spatial.transform import Rotation

from gsl.policies import gait
from gsl.policies.walk_engine import TABLE_1, WalkEngine
from gsl.robots.nao import nao

INERT = ("max_left", "max_turn", "max_left_change", "max_turn_change", "left_extra_foot_height", "pendulum_height")


@pytest.fixture(scope="module")
def env():
    env = world(start_noise=0.01).make()
    yield env
    env.close()


def travelled(env, engine: WalkEngine, seconds: float = 3.0, parameters=None) -> tuple[float, float, float]:
    """How far forward and left [m] and how far turned left [rad]; the robot must not fall."""
    seen, layout = walked(env, 0, seconds, engine, parameters), env.layout
    assert len(seen) == round(seconds / 0.02) + 1, "it fell"
    place, turn = seen[:, layout["base.position"]], seen[:, layout["base.orientation"]]
    yaw = np.unwrap(Rotation.from_quat(turn).as_euler("ZYX")[:, 0])
    return place[-1, 0] - place[0, 0], place[-1, 1] - place[0, 1], yaw[-1] - yaw[0]


def test_it_goes_where_it_is_asked_to(env) -> None:
    forward, _, straight = travelled(env, WalkEngine())
    assert forward > 0.4
    assert travelled(env, WalkEngine(forward=-0.1))[0] < -0.05
    stepping = travelled(env, WalkEngine(forward=0.0))
    assert abs(stepping[0]) < 0.1
    _, left, _ = travelled(env, WalkEngine(forward=0.0, left=0.1))
    _, right, _ = travelled(env, WalkEngine(forward=0.0, left=-0.1))
    assert left - stepping[1] > 0.05 and right - stepping[1] < -0.05
    leftwards, rightwards = (travelled(env, WalkEngine(forward=0.1, turn=turn))[2] for turn in (0.4, -0.4))
    assert leftwards > 0.3 and rightwards < -0.3 and abs(straight) < 0.5


def test_inert_parameters_change_nothing_in_a_straight_walk(env) -> None:
    engine = WalkEngine()
    other = np.array([2.0 * value if name in INERT else value for name, value in TABLE_1.items()])
    np.testing.assert_array_equal(walked(env, 0, 1.0, engine, other), walked(env, 0, 1.0, engine))
    live = engine.initial * np.where([name == "base_leg_lift" for name in TABLE_1], 1.1, 1.0)
    assert not np.array_equal(walked(env, 0, 1.0, engine, live), walked(env, 0, 1.0, engine))


def test_the_posture_is_within_the_joints_limits() -> None:
    robot, posture = nao(), gait.crouch(WalkEngine().initial)
    for name, angle in zip(robot.controlled, posture, strict=True):
        joint = robot.joint(name)
        assert joint.lower <= angle <= joint.upper, name
    crouch = np.array([robot.stance.get(name, angle) for name, angle in zip(robot.controlled, posture, strict=True)])
    np.testing.assert_allclose(posture, crouch, atol=5e-3)


def test_a_request_is_followed_by_its_change_a_step_and_clipped_to_its_most() -> None:
    values, state = WalkEngine().initial, gait.first_state()
    requests = []
    for k in range(200):
        side = 1.0 if (k // 14) % 2 else -1.0
        gait.step(values, state, np.array([1.0, 0.0, 0.0]), np.array([0.0, 25.0 * (1 + side), 25.0 * (1 - side)]), 0.02)
        requests.append(state[gait.FORWARD])
    levels = np.unique(requests)
    np.testing.assert_allclose(levels, [0.0, 0.15, 0.3])


def test_a_lifted_foot_goes_up_smoothly_and_comes_down_again() -> None:
    s = np.linspace(0.0, 1.0, 1001)
    profile = np.array([gait.lift_profile(value) for value in s])
    assert profile[0] == profile[-1] == 0.0 and profile.max() == pytest.approx(1.0)
    np.testing.assert_allclose(profile, profile[::-1], atol=1e-12)
    assert np.abs(np.diff(profile, 2)).max() < 5e-5


def test_without_contact_a_step_waits_three_periods() -> None:
    values, state = WalkEngine().initial, gait.first_state()
    ticks = 0
    while state[gait.WALKING] == 0.0:
        gait.step(values, state, np.array([0.3, 0.0, 0.0]), np.zeros(3), 0.02)
        ticks += 1
    assert ticks * 0.02 == pytest.approx(3.0 * TABLE_1["base_walk_period"], abs=0.05)
