"""Accurate replays: errors fall with the square of the step, and the nominal robot's are far below a noise floor."""

from __future__ import annotations

import numpy as np
import pytest

from gsl.core.plant import Plant
from gsl.effects.effect import apply_all, build
from gsl.robots.nao import nao
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.held import Held

pytestmark = pytest.mark.slow

PERIOD = 0.02
FINEST = 0.02 / 320  # of the reference [s]


def plant_with(effects: dict[str, dict[str, float]]) -> Plant:
    return apply_all(BulletWorld("nao", {}).plant, build(effects))


def replay(plant: Plant, step: float, accurate: bool) -> np.ndarray:
    """Return what encoders read through steps of half a radian and a sweep, shape (2, 101, n)."""
    robot = nao()
    rest = np.array([0.5 * (robot.joint(name).lower + robot.joint(name).upper) for name in robot.motors])
    time = np.arange(100) * PERIOD
    steps = rest + 0.05 * np.sign(np.sin(2 * np.pi * 0.8 * time))[:, None]
    sweep = rest + 0.1 * np.sin(2 * np.pi * time * (0.3 + 0.5 * time))[:, None]
    held = Held.of(plant, step, PERIOD, accurate)
    return np.array(held.play([steps, sweep], [rest, rest], 10))


def error(plant: Plant, step: float, accurate: bool) -> float:
    """Return the root mean square error of a replay against the finest one [rad]."""
    return float(np.sqrt(np.mean((replay(plant, step, accurate) - replay(plant, FINEST, True)) ** 2)))


def test_half_the_step_leaves_a_quarter_of_the_error() -> None:
    plant = plant_with({})
    coarse, fine = error(plant, 0.001, True), error(plant, 0.0005, True)
    assert fine < 0.35 * coarse
    assert coarse < 0.2 * error(plant, 0.001, False)


def test_both_schemes_agree_in_the_limit() -> None:
    plant = plant_with({})
    errors = [error(plant, step, False) for step in (0.001, 0.0005, 0.00025)]
    assert errors[1] == pytest.approx(0.5 * errors[0], rel=0.1)
    assert errors[2] == pytest.approx(0.5 * errors[1], rel=0.1)


@pytest.mark.parametrize(
    "effects",
    [
        {"coulomb_friction": {"torque": 0.05}},
        {"load_friction": {"coefficient": 0.1}},
        {"command_latency": {"delay": 0.012}},
        {"command_latency": {"delay": 0.0123}},
        {"target_smoothing": {"time_constant": 0.02}},
        {"sensor_delay": {"delay": 0.001}},
        {"torque_limit": {"factor": 0.5}},
        {"stribeck_friction": {"torque": 0.05}},
        {"supply_sag": {"resistance": 0.3}},
    ],
)
def test_every_law_without_a_second_mass_gains(effects: dict[str, dict[str, float]]) -> None:
    plant = plant_with(effects)
    assert error(plant, 0.001, True) < 0.6 * error(plant, 0.001, False)
