"""Torque noise deflects joints as a load does: by the constant over the gain, and as linear systems theory says."""

from typing import Any

import numpy as np
from bodies import STANCE, followed, held, world
from scipy.linalg import solve_discrete_lyapunov

from gsl.core.body import lump
from gsl.core.dynamics import mass_matrix
from gsl.core.plant import noiseless, nominal
from gsl.diagnosis.hypothesis.candidates import library
from gsl.effects.effect import apply_all, build
from gsl.robots.nao import nao
from gsl.worlds.bullet import BulletEnv, BulletWorld
from gsl.worlds.torque_noise import TorqueNoise

STEP = 0.002


def at_rest(effects: dict[str, Any], seeds: range, periods: int = 60) -> np.ndarray:
    """Motor positions while the stance is held, shape (seeds, periods, n_motors)."""
    env: BulletEnv = held(effects).make()
    rows = []
    for seed in seeds:
        env.reset(seed=seed, options={"posture": STANCE})
        for _ in range(periods):
            env.step(STANCE)
            assert env.engine is not None
            rows.append(env.engine.read().motion[0].copy())
    env.close()
    return np.array(rows).reshape(len(seeds), periods, -1)


def test_a_constant_torque_deflects_a_joint_by_its_size_over_the_gain() -> None:
    servo, sd = nominal(nao()).servo, 0.2
    clean = at_rest({}, range(1))[0, -1]
    noisy = at_rest({"torque_noise": {"constant": sd}}, range(24))
    torque = servo.kp * (noisy[:, -1] - clean)
    assert abs(torque.std() / sd - 1.0) < 0.12  # of 384 draws: 3 % and what gravity adds
    np.testing.assert_allclose(noisy[:, -1], noisy[:, -10], atol=2e-5)  # the same all the episode long
    stiff = {"servo_gain": {"kp": 2.0, "kd": 1.5}}
    difference = at_rest({**stiff, "torque_noise": {"constant": sd}}, range(8))[:, -1] - at_rest(stiff, range(1))[0, -1]
    ratio = (difference * (noisy[:8, -1] - clean)).sum() / ((noisy[:8, -1] - clean) ** 2).sum()
    assert abs(ratio - 0.5) < 0.04


def test_white_torque_trembles_as_a_linear_system_driven_by_white_noise_does() -> None:
    robot, servo, sd = lump(nao()), nominal(nao()).servo, 0.3
    stance = dict(zip(robot.motors, at_rest({}, range(1))[0, -1], strict=True))
    inertia = mass_matrix(robot, stance)[6:, 6:] + np.diag(servo.armature)
    inverse, n = np.linalg.inv(inertia), len(robot.motors)
    answer = np.block([[-inverse * servo.kp, -inverse * servo.kd]])
    speed = np.hstack([np.zeros((n, n)), np.eye(n)]) + STEP * answer
    system = np.vstack([np.hstack([np.eye(n), np.zeros((n, n))]) + STEP * speed, speed])
    drive = np.vstack([STEP**2 * inverse, STEP * inverse])
    wanted = np.sqrt(np.diag(solve_discrete_lyapunov(system, sd**2 * drive @ drive.T))[:n])
    seen = at_rest({"torque_noise": {"step": sd}}, range(6), 200)[:, 20:].reshape(-1, n).std(axis=0)
    np.testing.assert_allclose(seen, wanted, rtol=0.15)
    assert abs((seen / wanted).mean() - 1.0) < 0.05


def test_it_acts_on_the_joints_of_its_scope_alone_and_draws_nothing_for_others() -> None:
    plant = apply_all(nominal(nao()), build({"torque_noise": {"step": 0.2, "constant": 0.1, "joints": "arms"}}))
    noise = TorqueNoise(plant.torque_noise, 10, np.random.default_rng(0))
    drawn = np.array([noise.draw() for _ in range(400)])
    mask = plant.mask("arms")
    np.testing.assert_array_equal(drawn[..., ~mask], 0.0)
    np.testing.assert_allclose(drawn[..., mask].std(axis=(0, 1)), 0.2, rtol=0.05)
    assert (np.abs(drawn[..., mask].mean(axis=(0, 1))) > 0.01).any()


def episode(made: BulletWorld, seed: int) -> np.ndarray:
    env = made.make()
    rows = followed(env, np.tile(STANCE, (25, 1)), seed)
    env.close()
    return rows


def test_an_episode_is_a_function_of_its_seed_and_no_other_noise_changes() -> None:
    noise = {"torque_noise": {"step": 0.1, "constant": 0.1}}
    first, again, other = (episode(world(noise), seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 1e-3
    log = {"encoder_noise": {"sd": 0.002}}
    silent = {"torque_noise": {"step": 0.0, "constant": 0.0}}
    np.testing.assert_array_equal(episode(held({**log, **silent}), 3), episode(held(log), 3))
    quiet, moved = episode(held(log), 3), episode(held({**log, **noise}), 3)
    clean, shaken = episode(held(), 3), episode(held(noise), 3)
    where = slice(0, 15)
    np.testing.assert_allclose((quiet - clean)[:, where], (moved - shaken)[:, where], atol=1e-12)


def test_no_replay_has_it_and_no_diagnosis_tries_it() -> None:
    assert "torque_noise" not in {candidate.effect for candidate in library(nao())}
    plant = apply_all(nominal(nao()), build({"torque_noise": {"step": 0.2, "constant": 0.1}}))
    assert not noiseless(plant).torque_noise.any()
