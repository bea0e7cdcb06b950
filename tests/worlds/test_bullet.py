"""The world as an environment: what it promises whoever acts in it."""

import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from bodies import STANCE, held, walked, world
from gymnasium.utils.env_checker import check_env

from gsl.errors import ConfigError, GslError
from gsl.worlds.bullet import BulletEnv
from gsl.worlds.physics import Reading
from gsl.worlds.start import Start

SECONDS = 0.8


@pytest.fixture(scope="module")
def env():
    env = world().make()
    yield env
    env.close()


@pytest.mark.parametrize("floating", [True, False])
def test_gymnasium_accepts_the_environment(floating: bool) -> None:
    env = world(floating=floating, settle=0.1).make()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*(symmetric and normalized|minimum value|maximum value).*")
        check_env(env, skip_render_check=True)
    env.close()


def test_a_rollout_depends_on_its_seed_and_on_nothing_before_it(env: BulletEnv) -> None:
    first = walked(env, 1, SECONDS)
    other = walked(env, 2, SECONDS)
    assert not np.array_equal(first, other)
    np.testing.assert_array_equal(walked(env, 1, SECONDS), first)
    np.testing.assert_array_equal(walked(env, 2, SECONDS), other)
    walked(env, 3, 0.02)
    np.testing.assert_array_equal(walked(env, 1, SECONDS), first)
    env.reset(seed=5)
    np.testing.assert_array_equal(walked(env, 1, SECONDS), first)


def test_falls_and_short_rollouts_leave_nothing_behind() -> None:
    used, fresh = world().make(), world().make()
    rng = np.random.default_rng(0)
    low, high = used.action_space.low, used.action_space.high
    for length in (1, 40, 3, 60, 2, 50):
        used.reset(seed=int(rng.integers(1000)))
        for _ in range(length):
            if used.step(rng.uniform(low, high))[2]:
                break
    np.testing.assert_array_equal(walked(used, 1, SECONDS), walked(fresh, 1, SECONDS))
    used.close()
    fresh.close()


def test_another_world_beside_it_changes_nothing(env: BulletEnv) -> None:
    first = walked(env, 1, SECONDS)
    beside = world({"link_mass": {"link": "torso", "mass": 0.5}}, step=0.001).make()
    walked(beside, 4, 0.1)
    np.testing.assert_array_equal(walked(env, 1, SECONDS), first)
    walked(beside, 4, 0.02)
    fresh = world().make()
    np.testing.assert_array_equal(walked(fresh, 1, SECONDS), first)
    beside.close()
    fresh.close()


def test_another_process_computes_the_same_bytes(env: BulletEnv) -> None:
    said = f"sys.stdout.buffer.write(walked(world().make(), 1, {SECONDS}).tobytes())"
    code = f"import sys; from bodies import walked, world; {said}"
    root = Path(__file__).parents[2]
    process = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code],
        capture_output=True,
        check=True,
        cwd=root,
        env={**os.environ, "PYTHONPATH": f"{root / 'tests/support'}:{root}"},
    )
    assert process.stdout == walked(env, 1, SECONDS).tobytes()


def test_start_noise_makes_episodes_differ_and_without_it_they_are_copies() -> None:
    still = world(start_noise=0.0).make()
    np.testing.assert_array_equal(walked(still, 1, 0.1), walked(still, 2, 0.1))
    still.close()


def test_the_start_walk_walks(env: BulletEnv) -> None:
    seen = walked(env, 0, 3.0)
    forward = seen[:, env.layout["base.position"].start]
    assert len(seen) == 151, "it fell"
    assert 0.12 < (forward[-1] - forward[0]) / 3.0 < 0.30


def test_an_episode_ends_with_a_fall(env: BulletEnv) -> None:
    env.reset(seed=0, options={"posture": STANCE})
    backwards = STANCE.copy()
    backwards[[4, 9]] = 0.9
    for _ in range(150):
        observation, reward, fell, truncated, info = env.step(backwards)
        assert reward == 0.0 and not truncated and info["fell"] == fell
        if fell:
            break
    assert fell
    assert observation[env.layout["base.position"]][2] < 0.3


def test_standing_the_feet_carry_the_weight(env: BulletEnv) -> None:
    env.reset(seed=0, options={"posture": STANCE})
    forces = [env.step(STANCE)[0][env.layout["foot_force"]] for _ in range(50)]
    assert np.mean(np.sum(forces, axis=1)) == pytest.approx(5.305 * 9.81, rel=0.02)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_action_that_is_no_number_is_refused_by_name(value: float) -> None:
    env = held().make()
    env.reset(seed=0)
    action = np.zeros(15)
    action[3] = value
    with pytest.raises(GslError, match="LKneePitch"):
        env.step(action)
    env.step(np.zeros(15))
    env.close()


def test_an_action_of_another_size_is_refused() -> None:
    env = held().make()
    env.reset(seed=0)
    with pytest.raises(GslError, match=r"15 .*16"):
        env.step(np.zeros(16))
    env.close()


def start_at(env: BulletEnv, seen: np.ndarray, actions: np.ndarray, row: int) -> Start:
    """The measured state of one row and the actions before it, newest first."""
    layout, drive, at = env.layout, env.world.plant.robot.drive, seen[row]
    motion = np.array([at[layout["position"]][drive], at[layout["velocity"]][drive]])
    place, turn, speed = (at[layout[f"base.{part}"]] for part in ("position", "orientation", "velocity"))
    reading = Reading(motion, place, tuple(turn), speed, at[layout["gyro"]], 1.0, np.zeros(0))
    return Start(reading, actions[row - 1 :: -1][:, drive])


def test_a_recording_goes_on_from_its_own_state_in_the_air() -> None:
    env = held({"command_latency": {"delay": 0.03}}).make()
    rng, layout = np.random.default_rng(0), env.layout
    actions = STANCE + 0.3 * np.sin(np.arange(60)[:, None] * 0.12 + rng.uniform(0.0, 6.0, 15))
    observation, _ = env.reset(seed=0, options={"posture": STANCE})
    seen = np.array([observation, *(env.step(action)[0] for action in actions)])
    for row in (20, 35, 50):
        env.reset(seed=0, options={"start": start_at(env, seen, actions, row)})
        again = np.array([env.step(action)[0] for action in actions[row : row + 5]])
        recorded = seen[row + 1 : row + 6]
        np.testing.assert_allclose(again[:, layout["position"]], recorded[:, layout["position"]], atol=0.02)
        moved = np.abs(recorded[-1] - seen[row])[layout["position"]].max()
        assert moved > 0.1
    env.close()


def test_a_measured_base_is_taken_up_as_it_is(env: BulletEnv) -> None:
    seen = walked(env, 3, 1.0)
    layout = env.layout
    begun, _ = env.reset(seed=0, options={"start": start_at(env, seen, np.tile(STANCE, (50, 1)), 40)})
    for part in ("position", "velocity", "gyro", "base.position", "base.velocity"):
        np.testing.assert_allclose(begun[layout[part]], seen[40][layout[part]], atol=1e-5, err_msg=part)
    assert abs(begun[layout["base.orientation"]] @ seen[40][layout["base.orientation"]]) == pytest.approx(1.0, abs=1e-6)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ConfigError, match="multiple"):
        world(step=0.003)
    with pytest.raises(ConfigError, match="delay"):
        world({"command_latency": {"delay": 0.28}}, period=0.002, step=0.002)
