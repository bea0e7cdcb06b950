"""Velocity motors: a joint is on its target at the next tick, and a load below the torque limit does not move it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import STANCE, followed, held, walked, world
from commands import gsl

from gsl.errors import ConfigError
from gsl.worlds.velocity_motors import check_servos

PERIOD = 0.02
SHOULDER = 11  # LShoulderPitch among the controlled joints
SPEED = 0.3  # [rad/s] that the torque limit lets the arm reach within a physics step
SOLVED = 1e-4  # [rad] of what the engine's solver leaves of a constraint; an encoder's step is 1.5e-3


def motors(effects: Mapping[str, Any] | None = None, **settings: Any) -> Any:
    return held(effects, motors="velocity", step=0.005, **settings)


def played(actions: np.ndarray, effects: Mapping[str, Any] | None = None) -> np.ndarray:
    """Positions before each action and after the last one, shape (T + 1, n_joints)."""
    env = motors(effects).make()
    seen = followed(env, actions)[:, : actions.shape[1]]
    env.close()
    return seen


def ramp(speed: float, ticks: int = 60) -> np.ndarray:
    """Targets that move one shoulder at a constant speed [rad/s] after five ticks of rest, shape (T, n_joints)."""
    actions = np.tile(STANCE, (ticks, 1))
    actions[:, SHOULDER] -= speed * PERIOD * np.maximum(0, np.arange(ticks) - 5)
    return actions


def test_a_joint_follows_its_path_one_tick_late() -> None:
    actions = ramp(SPEED)
    np.testing.assert_allclose(played(actions)[1:], actions, atol=SOLVED)


def test_it_is_never_faster_than_its_greatest_speed() -> None:
    actions = np.tile(STANCE, (40, 1))
    actions[5:, SHOULDER] -= 2.5
    path = played(actions)[:, SHOULDER]
    speeds = -np.diff(path) / PERIOD
    fastest = world().plant.robot.joint("LShoulderPitch").max_velocity
    assert fastest - 1e-3 < speeds.max() < fastest + 1e-3
    assert path[-1] == pytest.approx(STANCE[SHOULDER] - 2.5, abs=SOLVED)


@pytest.mark.parametrize("delay", [0.007, 0.02, 0.06])
def test_a_latency_shifts_a_ramp_by_itself(delay: float) -> None:
    actions = ramp(SPEED)
    late = played(actions, {"command_latency": {"delay": delay}})[1:, SHOULDER]
    np.testing.assert_allclose(late[15:], actions[15:, SHOULDER] + SPEED * delay, atol=SOLVED)


def test_smoothing_is_a_first_order_lag() -> None:
    time_constant, actions = 0.025, np.tile(STANCE, (40, 1))
    actions[5:, SHOULDER] -= 0.01
    path = played(actions, {"target_smoothing": {"time_constant": time_constant}})[6:, SHOULDER]
    after = PERIOD * np.arange(1, len(path) + 1)
    np.testing.assert_allclose(path, STANCE[SHOULDER] - 0.01 * (1.0 - np.exp(-after / time_constant)), atol=SOLVED)


def test_smoothing_makes_a_ramp_late_by_the_sampled_filters_lag() -> None:
    time_constant, actions = 0.025, ramp(SPEED)
    path = played(actions, {"target_smoothing": {"time_constant": time_constant}})[1:, SHOULDER]
    passed = np.exp(-PERIOD / time_constant)  # share of an error that one tick leaves
    lag = PERIOD * passed / (1.0 - passed)
    np.testing.assert_allclose(path[30:], actions[30:, SHOULDER] + SPEED * lag, atol=SOLVED)


def test_a_zero_offset_shifts_a_joint_and_a_deadband_leaves_it_short_of_its_target() -> None:
    actions = np.tile(STANCE, (20, 1))
    actions[5:, SHOULDER] -= 0.02
    shifted = played(actions, {"zero_offset": {"offset": 0.01}})[-1]
    np.testing.assert_allclose(shifted, actions[-1] + 0.01, atol=SOLVED)
    assert played(actions, {"deadband": {"width": 0.01}})[-1, SHOULDER] == pytest.approx(
        actions[-1, SHOULDER] + 0.01, abs=SOLVED
    )


def test_a_target_is_rounded() -> None:
    last = played(np.tile(STANCE, (20, 1)), {"quantisation": {"step": 0.05}})[-1]
    np.testing.assert_allclose(last, 0.05 * np.rint(STANCE / 0.05), atol=SOLVED)


def arm_under(newton: float, effects: Mapping[str, Any] | None = None) -> float:
    """Farthest that a push on the hand moves the shoulder [rad]; the arm points forwards, the push goes down."""
    actions = np.tile(STANCE, (40, 1))
    actions[:, SHOULDER] = 0.0
    push = {"link": "LHand", "x": 0.0, "y": 0.0, "z": -newton, "start": 0.2, "duration": 0.2}
    path = played(actions, {"external_push": push, **(effects or {})})[:, SHOULDER]
    return float(np.abs(path - path[5]).max())


def arms_own_torque() -> tuple[float, float]:
    """Torque of the arm's weight about the shoulder [N·m] and the lever of the hand's centre of mass [m]."""
    from gsl.core.dynamics import forward_kinematics

    robot = world().plant.robot
    angles = dict(zip(robot.controlled, STANCE, strict=True)) | {"LShoulderPitch": 0.0}
    angles |= {"RHipYawPitch": angles["LHipYawPitch"]} | {
        j.name: j.fixed_at for j in robot.joints if j.fixed_at is not None
    }
    frames = forward_kinematics(robot, angles)
    axis_x = frames.origin["LShoulder"][0]
    own, lever = 0.0, 0.0
    for name in ("LShoulder", "LBicep", "LElbow", "LForeArm", "LHand"):
        com = frames.origin[name] + frames.turn[name] @ robot.links[name].com
        own += 9.81 * robot.links[name].mass * (com[0] - axis_x)
        lever = com[0] - axis_x
    return own, lever


def test_a_load_below_the_torque_limit_does_not_move_a_joint_and_a_load_above_does() -> None:
    limit = world().plant.robot.joint("LShoulderPitch").effort
    own, lever = arms_own_torque()
    least = (limit - own) / lever  # push that takes all the torque there is [N]
    assert arm_under(0.95 * least) < 2e-3 < 0.05 < arm_under(1.1 * least)


def test_a_torque_limit_acts() -> None:
    limit = world().plant.robot.joint("LShoulderPitch").effort
    own, lever = arms_own_torque()
    half = (0.7 * limit - own) / lever
    weaker = {"torque_limit": {"factor": 0.7}}
    assert arm_under(0.95 * half, weaker) < 2e-3 < 0.05 < arm_under(1.15 * half, weaker)
    assert arm_under(1.15 * half) < 2e-3


def test_a_walk_has_the_same_bytes_with_the_same_seed() -> None:
    env, fresh = (world({"action_noise": {"sd": 0.01}}, motors="velocity", step=0.005).make() for _ in range(2))
    first = walked(env, 1, 0.8)
    assert not np.array_equal(walked(env, 2, 0.8), first)
    np.testing.assert_array_equal(walked(env, 1, 0.8), first)
    np.testing.assert_array_equal(walked(fresh, 1, 0.8), first)
    env.close()
    fresh.close()


@pytest.mark.parametrize(
    ("name", "entry"),
    [
        ("servo_gain", {"kp": 0.5}),
        ("coulomb_friction", {"torque": 0.1}),
        ("backlash", {"width": 0.02}),
        ("joint_compliance", {"compliance": 0.004}),
        ("armature", {"inertia": 0.01}),
        ("joint_limit", {"reduction": 0.1, "side": "both"}),
        ("sensor_delay", {"delay": 0.01}),
    ],
)
def test_effects_on_what_such_motors_do_not_have_are_refused(name: str, entry: dict[str, Any]) -> None:
    with pytest.raises(ConfigError) as refused:
        motors({name: entry})
    assert str(refused.value) == f"effects.{name}: does not act on velocity motors; leave it out, or take motors=servo"


@pytest.mark.parametrize(
    "effects",
    [
        {"encoder_noise": {"sd": 0.001}},
        {"sensor_bias": {"bias": 0.01}},
        {"link_mass": {"link": "torso", "mass": 0.2}},
        {"ground_friction": {"friction": 0.6}},
        {"servo_gain": {"kp": 1.0}},
    ],
)
def test_effects_on_anything_else_are_not(effects: dict[str, Any]) -> None:
    motors(effects)


def test_a_simulator_with_such_motors_is_not_diagnosed(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="replayed with servos alone"):
        check_servos("velocity")
    for stage in ("diagnose", "identify"):
        said = gsl(stage, "real=log.parquet", "sim=nao_motors", folder=tmp_path)
        line = "sim.motors = velocity: logs are replayed with servos alone; take a simulator with motors=servo"
        assert said.code == 2 and said.lines[-1] == f"gsl {stage}: {line}"
