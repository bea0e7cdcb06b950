"""Desired speeds and feed-forward torques beside the targets, against a pendulum's equation solved by scipy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gsl.core.body import lump
from gsl.core.plant import GRAVITY, Plant, nominal
from gsl.robots.nao import nao
from gsl.robots.pendulum import ARM_MASS, ARMATURE, pendulum
from gsl.worlds.engine import Engine
from gsl.worlds.held import Held, Windows
from gsl.worlds.physics import Physics
from gsl.worlds.servo_state import COMMANDS
from gsl.worlds.start import resting

PERIOD, TICKS, START = 0.02, 60, 0.2
MASS, LENGTH = 0.49, 0.10  # of Rhoban's bench [kg], [m]
INERTIA = (MASS + ARM_MASS / 3.0) * LENGTH**2 + ARMATURE
WEIGHT = (MASS + 0.5 * ARM_MASS) * GRAVITY * LENGTH
SERVOS = {  # kp [N·m/rad], kd [N·m·s/rad], delay [s]
    "all three commands": (1.2, 0.05, 0.0),
    "all three, late": (1.2, 0.05, 0.013),
    "torque control": (0.0, 0.0, 0.0),
    "torque control, late": (0.0, 0.02, 0.033),
    "velocity control": (0.0, 0.3, 0.007),
}


def commands(name: str) -> np.ndarray:
    """Target [rad], speed [rad/s] and torque [N·m] of each control period, shape (T, 3)."""
    time = PERIOD * np.arange(TICKS)
    target, speed = START + 0.3 * np.sin(5.0 * time), 1.5 * np.cos(5.0 * time)
    torque = WEIGHT * np.sin(target) + 0.05 * np.sin(9.0 * time)
    return np.stack([target, speed, 0.0 * torque if "velocity" in name else torque], axis=1)


def solve(kp: float, kd: float, delay: float, sent: np.ndarray) -> np.ndarray:
    """Return the pendulum's angle after each control period [rad], commands held from when they arrive, shape (T,)."""

    def motion(_: float, state: np.ndarray, target: float, speed: float, torque: float) -> list[float]:
        q, v = state
        drive = kp * (target - q) + kd * (speed - v) + torque
        return [v, (drive - WEIGHT * np.sin(q)) / INERTIA]

    ends = sorted({*(PERIOD * np.arange(TICKS + 1)), *(PERIOD * np.arange(TICKS) + delay % PERIOD)})
    state, angles = np.array([START, 0.0]), {}
    for begin, end in zip(ends, ends[1:], strict=False):
        row = max(0, int(np.floor((begin - delay) / PERIOD + 1e-6)))
        state = solve_ivp(motion, (begin, end), state, args=tuple(sent[row]), rtol=1e-10, atol=1e-12).y[:, -1]
        angles[end] = state[0]
    return np.array([angles[PERIOD * k] for k in np.arange(1, TICKS + 1)])


def unlimited(kp: float, kd: float, delay: float) -> Plant:
    numbers = {"kp": kp, "kd": kd, "delay": delay, "limit": np.inf, "no_load_speed": np.inf}
    return nominal(pendulum()).with_servo(**{name: np.array([value]) for name, value in numbers.items()})


def window(sent: np.ndarray, start: np.ndarray) -> Windows:
    padded = np.vstack([np.repeat(sent[:1], COMMANDS - 1, axis=0), sent])
    return Windows(np.ascontiguousarray(padded[::-1])[None], np.array([[start, 0.0 * start]]), np.zeros(1))


def in_bullet(plant: Plant, sent: np.ndarray, start: np.ndarray, step: float) -> np.ndarray:
    engine, seen = Engine(plant, Physics(step, 50, PERIOD, floating=False)), []
    engine.load(resting(lump(plant.robot), start, start, floating=False).reading, sent[:1])
    for row in sent:
        engine.run(row)
        seen.append(engine.encoders(engine.read())[0])
    engine.close()
    return np.array(seen)


@pytest.mark.parametrize("name", SERVOS)
def test_the_chain_model_does_what_the_equation_says(name: str) -> None:
    sent = commands(name)
    played = Held.of(unlimited(*SERVOS[name]), 0.0005, PERIOD, accurate=True).replay(window(sent, np.array([START])))
    truth = solve(*SERVOS[name], sent)
    assert np.ptp(truth) > 0.1
    np.testing.assert_allclose(played[0, :, 0], truth, atol=2e-5)


@pytest.mark.parametrize("name", ["all three, late", "torque control", "velocity control"])
def test_bullet_does_so_to_first_order_of_its_step(name: str) -> None:
    sent, truth = commands(name), solve(*SERVOS[name], commands(name))
    start = np.array([START])
    coarse, fine = (in_bullet(unlimited(*SERVOS[name]), sent, start, step)[:, 0] - truth for step in (0.001, 0.0005))
    assert np.abs(fine).max() < 2e-3
    assert np.abs(fine).max() < 0.6 * np.abs(coarse).max()


def test_commands_of_zero_change_no_bit_in_bullet() -> None:
    robot = lump(nao())
    n, rng = len(robot.motors), np.random.default_rng(0)
    targets, start = 0.1 * rng.standard_normal((20, n)), np.zeros(n)
    wide = np.hstack([targets, np.zeros((20, 2 * n))])
    plant = replace(nominal(robot), robot=robot)
    assert in_bullet(plant, wide, start, 0.002).tobytes() == in_bullet(plant, targets, start, 0.002).tobytes()
