"""A test stand: joints of known inertia under the servos of a plant with effects, and a load of one's own."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from gsl.core.body import Joint, Link, Robot
from gsl.core.plant import nominal
from gsl.effects.effect import apply_all, build
from gsl.worlds.servo import encoder_motion, servo_torque
from gsl.worlds.servo_state import OUTPUT_ARMATURE, first_state, pack

STEP, PERIOD = 0.002, 0.02
KP, KD, LIMIT, NO_LOAD, ARMATURE, REACH = 20.0, 1.0, 3.0, 7.0, 0.007, 2.0
LINK = 0.01  # inertia of what hangs on a joint [kg·m²]
TORQUE_CONSTANT, VOLTAGE = 2.5, 20.0


class Log(NamedTuple):
    """What happened, a row a control step from the start on, each of shape (T + 1,) or (T + 1, n).

    Attributes:
        told: What the encoders say [rad].
        true: Where the outputs are [rad].
        torque: At the outputs, in the last physics step [N·m].
    """

    told: np.ndarray
    true: np.ndarray
    torque: np.ndarray


def robot(joints: int = 1, encoder_side: str = "output", gains: tuple[float, float] = (KP, KD)) -> Robot:
    """Joints side by side on one base."""
    names = [f"J{i}" for i in range(joints)]
    links = {name: Link(name, 0.1, np.zeros(3), np.eye(3) * 1e-3) for name in ("base", *names)}
    hinge = {"origin": np.zeros(3), "axis": np.array([0.0, 1.0, 0.0]), "lower": -REACH, "upper": REACH}
    made = tuple(
        Joint(f"J{i}", "base", f"J{i}", **hinge, max_velocity=NO_LOAD, effort=LIMIT, armature=ARMATURE)
        for i in range(joints)
    )
    return Robot(
        "stand", links, made, tuple(names), gains=dict.fromkeys(names, gains), no_load_speed=1.0,
        supply_voltage=VOLTAGE, torque_constant=dict.fromkeys(names, TORQUE_CONSTANT), encoder_side=encoder_side,
    )  # fmt: skip


def run(
    effects: Mapping[str, Any],
    targets: np.ndarray,
    load: float | Callable[[float], float] = 0.0,
    *,
    locked: bool = False,
    every_step: bool = False,
    **of_robot: Any,
) -> Log:
    """Issue `targets` [rad], shape (T,) for all joints alike or (T, n), from rest in the first one.

    Args:
        effects: As in a world's yaml.
        targets: One a control period.
        load: Torque on each output [N·m], as it is or as a function of time.
        locked: Hold the outputs where they start.
        every_step: Log every physics step, the start left out.
        **of_robot: For `robot`.
    """
    plant = apply_all(nominal(robot(**of_robot)), build(effects))
    parameters, n = pack(plant.servo, plant.robot.supply_voltage), len(plant.robot.motors)
    paths = np.broadcast_to(targets[:, None] if targets.ndim == 1 else targets, (len(targets), n))
    motion, torque = np.array([paths[0], np.zeros(n)]), np.zeros(n)
    state, rows = first_state(paths[:1], motion, STEP), []
    inertia = LINK + parameters.rows[OUTPUT_ARMATURE]

    def note() -> None:
        encoders = np.empty((2, n))
        encoder_motion(parameters, state, motion, STEP, encoders)
        rows.append((encoders[0], motion[0].copy(), torque.copy()))

    note()
    for tick, target in enumerate(paths):
        state.commands[1:] = state.commands[:-1].copy()
        state.commands[0] = target
        for k in range(round(PERIOD / STEP)):
            servo_torque(parameters, state, motion, k * STEP, STEP, PERIOD, torque)
            outside = load(tick * PERIOD + k * STEP) if callable(load) else load
            motion[1] += 0.0 if locked else STEP * (torque + outside) / inertia
            motion[0] += STEP * motion[1]
            if every_step:
                note()
        state.clock[0] += PERIOD
        if not every_step:
            note()
    logged, true, torques = (np.array(column)[1 if every_step else 0 :] for column in zip(*rows, strict=True))
    return Log(*(each[:, 0] if n == 1 else each for each in (logged, true, torques)))


def held(angle: float, seconds: float) -> np.ndarray:
    """One target for some time."""
    return np.full(round(seconds / PERIOD), angle)


def step(height: float, seconds: float = 1.0, *, after: int = 5) -> np.ndarray:
    """A step after some control periods."""
    return np.where(np.arange(round(seconds / PERIOD)) < after, 0.0, height)


def ramp(speed: float, seconds: float) -> np.ndarray:
    """Targets that grow evenly [rad/s]."""
    return speed * PERIOD * np.arange(round(seconds / PERIOD))


def sine(height: float, frequency: float, seconds: float) -> np.ndarray:
    """Targets that swing [Hz]."""
    return height * np.sin(2.0 * np.pi * frequency * PERIOD * np.arange(round(seconds / PERIOD)))
