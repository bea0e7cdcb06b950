"""Laws at random, by hand, and logs of a robot in the air to learn them from."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.plant import Plant, nominal
from gsl.core.servo_law import HIDDEN, INPUTS, LAGS, ServoLaw
from gsl.diagnosis.log.records import Pieces, Record, cut_pieces, slope
from gsl.effects.effect import apply_all, build
from gsl.robots.nao import nao
from gsl.worlds.held import Held

STEP, PERIOD = 0.002, 0.02
NAO = lump(nao())
EVERYTHING = {
    "smoothing": 0.01, "play": 0.01, "compliance": 0.01, "delay": 0.013, "sensor_delay": 0.005, "quantum": 0.001,
    "coulomb": 0.05, "stribeck": 0.05, "load_friction": 0.05, "duty_loss": 0.1, "fade": 0.1, "deadband": 0.002,
    "supply_resistance": 0.2, "viscous": 0.01, "lower_stop": -0.3, "upper_stop": 0.3, "motor_encoder": 1.0,
}  # fmt: skip
"""All that a servo can have, by its fields."""


def with_fields(robot: Robot, fields: Mapping[str, float]) -> Plant:
    """The nominal plant whose servos all have the given fields."""
    return nominal(robot).with_servo(**{name: np.full(len(robot.motors), value) for name, value in fields.items()})


def with_effects(effects: Mapping[str, Any]) -> Plant:
    """NAO with effects."""
    return apply_all(nominal(NAO), build(effects))


def law(plant: Plant, *, lag: float = 0.0, weights: float = 0.0, last: float = 0.0, seed: int = 0) -> ServoLaw:
    """A law with two groups, its arrays drawn at random with the given standard deviations; all zero is no law."""
    rng, servo, n = np.random.default_rng(seed), plant.servo, len(plant.servo.kp)

    def drawn(sd: float, *shape: int) -> np.ndarray:
        return sd * rng.standard_normal(shape)

    return ServoLaw(
        np.arange(n) % 2, servo.kp / servo.limit, servo.limit.copy(), drawn(lag, n, LAGS),
        drawn(weights, 2, INPUTS, HIDDEN), drawn(weights, 2, HIDDEN), drawn(weights, 2, HIDDEN, HIDDEN),
        drawn(weights, 2, HIDDEN), drawn(last, 2, HIDDEN, 2), drawn(last, 2, 2),
    )  # fmt: skip


def some_law(plant: Plant, seed: int = 0) -> ServoLaw:
    """A law that matters: some percent of the torque limit."""
    return law(plant, lag=0.02, weights=0.4, last=0.02, seed=seed)


def log(plant: Plant, *, ticks: int = 80, swing: float = 0.15, warm_up: int = 5, scored: int = 15) -> Pieces:
    """Windows of a plant in the air whose targets are sines, each joint's its own."""
    robot, n, rng = plant.robot, len(plant.robot.motors), np.random.default_rng(5)
    time = PERIOD * np.arange(ticks)
    middle = np.array([0.5 * robot.stance.get(name, 0.0) for name in robot.controlled])
    m = len(middle)
    sines = np.sin(2.0 * np.pi * np.outer(time, rng.uniform(0.5, 1.5, m)) + rng.uniform(0.0, 6.0, m))
    targets = (middle + swing * sines)[:, robot.drive]
    position = Held.of(plant, STEP, PERIOD).play([targets], [targets[0]], settle=30)[0][:, :m]
    assert n >= m
    record = Record("sines", targets, position, slope(position, PERIOD))
    return cut_pieces([record], robot, PERIOD, warm_up=warm_up, scored=scored)


def lawful(plant: Plant, added: ServoLaw | None) -> Plant:
    """The plant with a law."""
    return replace(plant, law=added)
