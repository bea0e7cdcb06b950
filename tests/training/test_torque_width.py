"""The width of torque noise that explains residuals: a log with some gives it back, a log without gives none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from bodies import STANCE, followed, held

from gsl.core.plant import nominal
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.log.log import Log, cut_log
from gsl.effects.effect import apply_all, build
from gsl.robots.nao import nao
from gsl.training.torque_width import measure_widths
from gsl.worlds.held import Held, Windows
from gsl.worlds.servo_state import COMMANDS

pytestmark = pytest.mark.slow

PERIOD, NOISE = 0.02, {"encoder_noise": {"sd": 3e-4}}


def motion(seed: int, length: int = 200) -> np.ndarray:
    """Joints that swing about the stance, each at its own pace, shape (length, 15)."""
    rng, time = np.random.default_rng(seed), PERIOD * np.arange(length)[:, None]
    pace, phase = rng.uniform(0.3, 1.2, 15), rng.uniform(0.0, 2.0 * np.pi, 15)
    return STANCE + 0.15 * (np.sin(2.0 * np.pi * pace * time + phase) - np.sin(phase))


def log(effects: dict[str, Any], count: int = 16, about: dict[str, Any] | None = None) -> Log:
    """Motions in the air, every one with noise of its own."""
    world, episodes = held({**effects, **NOISE}), []
    env = world.make()
    for index in range(count):
        actions = motion(index)
        rows = followed(env, actions, index)
        position, velocity = (rows[:, env.layout[part]] for part in ("position", "velocity"))
        actions = np.vstack([actions, np.full(15, np.nan)])
        episodes.append(Trajectory(PERIOD * np.arange(len(rows)), actions, position, velocity))
    env.close()
    metadata = {
        "robot": "nao",
        "episodes": [{"policy": f"swing_{index}"} for index in range(count)],
        **({"world": {"step": 0.002}} if about is None else about),
    }
    return cut_log(Batch(tuple(episodes), nao().controlled, PERIOD, metadata), nao())


def widths(effects: dict[str, Any], conditions: dict[str, Any] | None = None) -> dict[str, tuple[float, float]]:
    both = measure_widths(log(effects), apply_all(nominal(nao()), build(conditions or {})), step=0.002)
    return {group: tuple(width) for group, width in both.items()}


LEGS, ARMS = {"constant": 0.1, "joints": "legs"}, {"constant": 0.04, "joints": "arms"}


def test_a_constant_torque_per_episode_gives_its_width_back() -> None:
    seen = widths({"torque_noise": [LEGS, ARMS]})
    assert seen["legs"] == (0.0, pytest.approx(0.1, rel=0.2)) and seen["arms"] == (0.0, pytest.approx(0.04, rel=0.2))


def test_friction_that_the_simulator_has_does_not_hide_it() -> None:
    dry = {"coulomb_friction": {"torque": 0.1}}
    seen = widths({**dry, "torque_noise": {"constant": 0.1}}, dry)
    assert seen["legs"][1] == pytest.approx(0.1, rel=0.2) and seen["legs"][0] == 0.0


def test_white_torque_gives_its_width_back_though_it_makes_the_log_rough_itself() -> None:
    for step, constant in widths({"torque_noise": {"step": 1.0}}).values():
        assert step == pytest.approx(1.0, rel=0.1) and constant < 0.03


def test_both_at_once_are_told_apart() -> None:
    seen = widths({"torque_noise": {"step": 0.5, "constant": 0.1}})
    assert seen["legs"] == (pytest.approx(0.5, rel=0.1), pytest.approx(0.1, rel=0.2))


def test_a_log_that_says_nothing_of_its_physics_is_replayed_as_the_world_moves() -> None:
    """In which the noise will act: an error of its time step is in the learned servo already and is no noise."""
    assert set(measure_widths(log({}, about={}), nominal(nao()), step=0.002).values()) == {(0.0, 0.0)}


def test_at_the_floor_there_is_none_and_a_wrong_gain_takes_some() -> None:
    assert set(widths({}).values()) == {(0.0, 0.0)}
    assert all(min(width) > 0.0 for width in widths({"servo_gain": {"kp": 0.9}}).values())


def test_a_replay_under_a_load_is_off_by_the_load_over_the_gain_and_without_one_has_its_bits() -> None:
    plant, n, period = nominal(nao()), 16, 20
    stance = STANCE[nao().drive]
    motion_at_rest = np.array([[stance, np.zeros(n)]])
    windows = Windows(np.tile(stance, (1, period + COMMANDS - 1, 1)), motion_at_rest, np.zeros(1))
    chain = Held.of(plant, 0.002, PERIOD)
    still, none = chain.replay(windows), chain.replay(windows, np.zeros((10 * period, n)))
    np.testing.assert_array_equal(still, none)
    moved = chain.replay(windows, np.full((10 * period, n), 0.05)) - still
    np.testing.assert_allclose(moved[0, -1], 0.05 / plant.servo.kp, rtol=0.03)
