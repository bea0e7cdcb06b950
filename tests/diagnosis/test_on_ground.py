"""Replays on the ground: where windows begin, what is calibrated, and how far robots of one make are apart."""

from dataclasses import replace

import numpy as np
import pytest

from gsl.core.body import lump
from gsl.core.plant import GRAVITY, Plant, nominal
from gsl.diagnosis.hypothesis.candidates import library
from gsl.diagnosis.log.log import Log, cut_log
from gsl.diagnosis.simulate import calibration
from gsl.diagnosis.simulate.on_ground import Walking, find_heights, jitter_error, read_motion
from gsl.effects.effect import apply_all, build
from gsl.robots.nao import nao
from gsl.worlds.bullet import BulletWorld
from gsl_benchmarks.blind.walks import Walks

NONE = np.zeros(0)


@pytest.fixture(scope="module")
def walk() -> Log:
    sim = BulletWorld(robot="nao", effects={}, start_noise=0.02)
    log = Walks(episodes=2, duration=1.0).log(sim, None, {}, 0.0, np.random.default_rng(0))
    return cut_log(log, lump(nao()), walking=True)


def plant(**effects: dict[str, float]) -> Plant:
    return apply_all(nominal(nao()), build(effects))


def test_a_bias_of_the_encoders_moves_the_log_and_not_the_robot(walk: Log) -> None:
    simulator = Walking(plant(), 0.002, 0.02)
    biased = replace(walk.pieces, windows=walk.pieces.windows._replace(motion=walk.pieces.windows.motion.copy()))
    biased.windows.motion[:, 0] += 0.03
    replayed = simulator.simulate({"sensor_bias": {"bias": 0.03}}, NONE, biased)
    joints = len(walk.joints)
    expected = simulator.simulate({}, NONE, walk.pieces)
    assert np.allclose(replayed[..., :joints] - 0.03, expected[..., :joints], atol=1e-9)
    assert np.allclose(replayed[..., joints:], expected[..., joints:], atol=1e-9)


def test_late_encoders_tell_of_where_joints_were() -> None:
    late = plant(sensor_delay={"delay": 0.01})
    n = len(late.robot.motors)
    measured = np.stack([np.zeros((3, n)), np.full((3, n), 2.0)], axis=1)
    assert np.allclose(read_motion(late, measured)[:, 0], 0.02)


def test_zeros_are_calibrated_in_the_log(walk: Log) -> None:
    simulator, joints = Walking(plant(), 0.002, 0.02), len(walk.joints)
    shifted = calibration.no_shifts(len(walk.channels))
    shifted[calibration.ZERO] = 0.01
    moved = simulator.simulate({}, shifted, walk.pieces) - simulator.simulate({}, NONE, walk.pieces)
    assert np.allclose(moved[..., :joints], 0.01) and not moved[..., joints:].any()


def test_soft_ground_is_entered_as_deep_as_the_log_has_it(walk: Log) -> None:
    windows = walk.pieces.windows
    windows = windows._replace(base=windows.base.copy())
    before = {k: find_heights(plant(ground_compliance={"stiffness": k}), windows) for k in (2e3, 1e8)}
    hard = find_heights(plant(), windows)
    assert np.allclose(before[1e8], hard, atol=1e-5)
    mass = nao().mass
    assert np.median(hard - before[2e3]) == pytest.approx(mass * GRAVITY / (8.0 * 2e3), rel=0.3)
    windows.base[0, 2] -= 2e-3
    assert np.allclose(find_heights(plant(), windows), hard)
    deeper = before[2e3] - find_heights(plant(ground_compliance={"stiffness": 2e3}), windows)
    assert 1e-3 < deeper[0] < 2e-3 and np.abs(deeper[1:]).max() < 5e-4  # the median moves a little


def test_robots_of_one_make_are_apart_by_more_in_the_joints_that_carry(walk: Log) -> None:
    simulator = Walking(plant(), 0.002, 0.02)
    error = jitter_error(simulator, walk.pieces, np.random.default_rng(0))
    names = dict(zip(walk.channels, error, strict=True))
    assert names["LKneePitch"] > 2.0 * names["LShoulderRoll"] and (error < 0.03).all()
    again = jitter_error(simulator, walk.pieces, np.random.default_rng(0))
    assert np.array_equal(error, again)


def test_a_stiffness_that_ranges_over_several_sizes_is_stepped_in_logarithms() -> None:
    candidates = {candidate.effect: candidate for candidate in library(nao(), floating=True)}
    assert candidates["ground_compliance"].ratios.all()
    assert not candidates["command_latency"].ratios.any() and not candidates["stribeck_friction"].ratios.any()


def test_a_torque_beside_the_targets_does_what_a_shift_of_the_targets_does(walk: Log) -> None:
    simulator, sent = Walking(plant(), 0.002, 0.02), walk.pieces.windows.commands
    shift = 0.01 * np.sin(np.arange(sent.shape[2]))
    torque = np.broadcast_to(simulator.plant.servo.kp * shift, sent.shape)

    def replayed(commands: np.ndarray) -> np.ndarray:
        windows = walk.pieces.windows._replace(commands=commands)
        return simulator.simulate({}, NONE, replace(walk.pieces, windows=windows))

    beside = replayed(np.concatenate([sent, 0.0 * sent, torque], axis=2))
    assert np.abs(beside - replayed(sent)).max() > 1e-3
    np.testing.assert_allclose(beside, replayed(sent + shift), atol=1e-5)
