"""The hand-written adjoint against differences of the costs that it returns, and frozen links against the chain."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from learned_servos import NAO, PERIOD, STEP, law, log, some_law, with_fields

from gsl.core.dynamics import mass_matrix
from gsl.core.lanes import LANES
from gsl.core.plant import Plant, nominal
from gsl.core.servo_law import ServoLaw
from gsl.diagnosis.log.records import Pieces
from gsl.training.adjoint import cost_and_gradient
from gsl.training.frozen import Frozen, freeze, heavier
from gsl.training.gradient import NUMBERS, Gradient
from gsl.training.replay_path import LOST
from gsl.worlds.held import Held, Windows
from gsl.worlds.servo_state import OUTPUT_ARMATURE, pack

pytestmark = pytest.mark.slow

SUBSTEPS, ROBUST = round(PERIOD / STEP), 3.0
N, JOINTS = len(NAO.motors), len(NAO.controlled)
FLOOR = np.full(JOINTS, 5e-4)
GENTLE = {"kp": 40.0, "kd": 1.0}  # with which a second mass or a late sensor does not make a servo chatter
TRUTH = {"coulomb": 0.15, "viscous": 0.05, "delay": 0.011}
BASES = {
    "nominal": {},
    "shifted": {"delay": 0.011, "offset": 0.01, "viscous": 0.02, "fade": 0.1, "limit": 0.6, "no_load_speed": 4.0},
    "friction": {"coulomb": 0.1, "load_friction": 0.05, "deadband": 0.002, "stribeck": 0.05},
    "load alone": {"load_friction": 0.05},
    "command": {"smoothing": 0.015, "delay": 0.013, "duty_loss": 0.1},
    "rounded": {"smoothing": 0.015, "quantum": 0.001, "delay": 0.013},
    "late": GENTLE | {"sensor_delay": 0.003},
    "spring": GENTLE | {"compliance": 0.01},
    "spring, motor encoder": GENTLE | {"compliance": 0.01, "motor_encoder": 1.0, "sensor_delay": 0.003},
    "play": GENTLE | {"play": 0.005},
    "play, motor encoder": GENTLE | {"play": 0.005, "motor_encoder": 1.0, "coulomb": 0.05},
    "sag": {"supply_resistance": 0.3},
}
"""What servos a law may stand on."""

TOLERANCE = {"friction": 1e-3, "load alone": 1e-3, "play": 1e-3, "sag": 0.02}
"""Load friction and teeth have corners that probes lie across; what joints share through the supply is left out."""

FACTORS = ("kp", "kd", "limit")
NAMES = (*FACTORS, "delay", "coulomb", "viscous", "deadband", "armature", "offset")  # in the order of the rows


@pytest.fixture(scope="module")
def pieces() -> Pieces:
    return log(with_fields(NAO, TRUTH), ticks=40, warm_up=1, scored=3)


def gradient_of(plant: Plant, data: Frozen, added: ServoLaw) -> tuple[float, Gradient]:
    to = Gradient(np.zeros((NUMBERS, N)), *(np.zeros_like(field) for field in added[3:]))
    servos = pack(plant.servo, NAO.supply_voltage, added)
    return cost_and_gradient(servos, data, np.arange(len(data.clock)), STEP, SUBSTEPS, ROBUST, to), to


def off(slope: np.ndarray, direction: np.ndarray, cost: Callable[[np.ndarray], float], *, ahead: bool = False) -> float:
    """How far a derivative is from differences, as a share of the gradient's length; the best of several sizes.

    Where teeth meet, a torque saturates or dry friction slips, a difference that lies across it is no derivative.
    """
    low = 0.0 if ahead else -1.0
    truth = [(cost(e * direction) - cost(low * e * direction)) / ((1.0 - low) * e) for e in (1e-6, 1e-7, 1e-8, 1e-9)]
    return float(np.abs(np.array(truth) - np.vdot(slope, direction)).min() / (np.linalg.norm(slope) or 1.0))


@pytest.mark.parametrize("name", BASES)
def test_derivatives_by_the_law_are_those_of_differences(name: str, pieces: Pieces) -> None:
    plant, rng = with_fields(NAO, BASES[name]), np.random.default_rng(1)
    added, data = some_law(plant), freeze(plant, pieces, FLOOR, PERIOD)
    gradient = gradient_of(plant, data, added)[1]
    for field in Gradient._fields[1:]:
        values = getattr(added, field)

        def cost(change: np.ndarray, field: str = field, values: np.ndarray = values) -> float:
            return gradient_of(plant, data, added._replace(**{field: values + change}))[0]

        direction = rng.standard_normal(values.shape)
        assert off(getattr(gradient, field), direction, cost) < TOLERANCE.get(name, 2e-4), field


@pytest.mark.parametrize("name", BASES)
def test_derivatives_by_the_numbers_are_those_of_differences(name: str, pieces: Pieces) -> None:
    """Rounded targets jump with the delay, and dry friction or a deadband has no derivative where there is none."""
    plant, rng = with_fields(NAO, BASES[name]), np.random.default_rng(2)
    added, data = some_law(plant), freeze(plant, pieces, FLOOR, PERIOD)
    gradient = gradient_of(plant, data, added)[1]
    dry = {"coulomb", "stribeck", "load_friction"} & set(BASES[name])
    left_out = (["delay"] if "quantum" in BASES[name] else []) + ([] if dry else ["coulomb"])
    for row, number in enumerate(NAMES):
        if number in left_out:
            continue

        def cost(change: np.ndarray, number: str = number) -> float:
            value = getattr(plant.servo, number)
            other = plant.with_servo(**{number: value * np.exp(change) if number in FACTORS else value + change})
            carried = pack(other.servo, NAO.supply_voltage).rows[OUTPUT_ARMATURE]
            more = carried - pack(plant.servo, NAO.supply_voltage).rows[OUTPUT_ARMATURE]
            return gradient_of(other, heavier(data, more), added)[0]

        ahead = number in ("delay", "deadband", "coulomb") and number not in BASES[name]  # they are never below zero
        direction = np.abs(rng.standard_normal(N))
        assert off(gradient.numbers[row], direction, cost, ahead=ahead) < TOLERANCE.get(name, 2e-4), number


@pytest.mark.parametrize("gains", [False, True])
@pytest.mark.parametrize("name", ["nominal", "command"])
def test_commands_beside_the_targets_are_part_of_the_derivatives(name: str, gains: bool, pieces: Pieces) -> None:
    plant, rng = with_fields(NAO, BASES[name] | {"delay": 0.013}), np.random.default_rng(4)
    targets, rows = pieces.windows.commands, pieces.windows.commands.shape[:2]
    shares = [rng.uniform(0.5, 1.5, (*rows, 2 * N))] if gains else []
    wide = np.concatenate([targets, rng.standard_normal((*rows, 2 * N)), *shares], axis=2)
    added, data = (
        some_law(plant),
        freeze(plant, replace(pieces, windows=pieces.windows._replace(commands=wide)), FLOOR, PERIOD),
    )
    gradient = gradient_of(plant, data, added)[1]
    for number in ("kp", "kd", "delay", "viscous"):

        def cost(change: np.ndarray, number: str = number) -> float:
            value = getattr(plant.servo, number)
            other = value * np.exp(change) if number in FACTORS else value + change
            return gradient_of(plant.with_servo(**{number: other}), data, added)[0]

        assert off(gradient.numbers[NAMES.index(number)], rng.standard_normal(N), cost) < 2e-4, number


def test_windows_add_up_and_each_counts_as_alone(pieces: Pieces) -> None:
    plant = with_fields(NAO, BASES["friction"])
    added, data = some_law(plant), freeze(plant, pieces, FLOOR, PERIOD)
    assert len(pieces) > LANES
    whole = gradient_of(plant, data, added)
    alone = [gradient_of(plant, part(data, np.array([w])), added) for w in range(len(pieces))]
    np.testing.assert_allclose(whole[0], sum(cost for cost, _ in alone), rtol=1e-12)
    for field, total in whole[1]._asdict().items():
        parts = np.sum([getattr(gradient, field) for _, gradient in alone], axis=0)
        np.testing.assert_allclose(total, parts, rtol=1e-8, atol=1e-10 * np.abs(parts).max())


def part(data: Frozen, index: np.ndarray) -> Frozen:
    per_window = {name: getattr(data, name)[index] for name in Frozen._fields[:6]}
    return data._replace(**per_window)


@pytest.mark.parametrize("speed", [1e300, 1e4])
def test_a_window_that_runs_away_has_a_finite_cost_and_no_derivative(speed: float, pieces: Pieces) -> None:
    plant = nominal(NAO)
    added, data = some_law(plant), freeze(plant, pieces, FLOOR, PERIOD)
    motion = data.motion.copy()
    motion[0, 1] = speed
    cost, gradient = gradient_of(plant, data._replace(motion=motion), added)
    rest = gradient_of(plant, part(data, np.arange(1, len(pieces))), added)
    scored = JOINTS * (pieces.real.shape[1] - pieces.warm_up)
    np.testing.assert_allclose(cost - rest[0], scored * ROBUST**2 * np.log1p((LOST / ROBUST) ** 2), rtol=1e-9)
    for field, total in gradient._asdict().items():
        parts = getattr(rest[1], field)
        np.testing.assert_allclose(total, parts, rtol=1e-8, atol=1e-10 * np.abs(parts).max())


@pytest.mark.parametrize("name", ["nominal", "shifted", "friction", "command", "late"])
def test_frozen_links_move_as_the_chain_does_where_the_replay_is_right(name: str) -> None:
    plant = with_fields(NAO, BASES[name])
    some = log(plant)
    windows = some.windows
    assert isinstance(windows, Windows)
    chain = Held.of(plant, STEP, PERIOD).replay(windows)[:, :, :JOINTS]
    data = freeze(plant, replace(some, real=chain, warm_up=0), FLOOR, PERIOD)
    silent = law(plant)
    to = Gradient(np.zeros((NUMBERS, N)), *(np.zeros_like(field) for field in silent[3:]))
    servos, wide = pack(plant.servo, NAO.supply_voltage, silent), 1e6  # all residuals count by their squares
    cost = cost_and_gradient(servos, data, np.arange(len(some)), STEP, SUBSTEPS, wide, to)
    assert np.sqrt(cost / chain.size) < 0.1


def test_frozen_terms_are_those_of_the_mass_matrix(pieces: Pieces) -> None:
    plant = nominal(NAO)
    data = freeze(plant, pieces, FLOOR, PERIOD)
    path = np.concatenate([data.motion[:, :1], pieces.real[:, :, NAO.drive]], axis=1)
    middle = 0.5 * (path[3, 1] + path[3, 2])
    inertia = mass_matrix(NAO, dict(zip(NAO.motors, middle, strict=True)))[6:, 6:] + np.diag(plant.servo.armature)
    np.testing.assert_allclose(data.mobility[3, 1] @ inertia, np.eye(N), atol=1e-9)


def test_heavier_windows_are_those_of_a_plant_with_more_armature(pieces: Pieces) -> None:
    plant, more = nominal(NAO), np.random.default_rng(0).uniform(0.0, 0.01, N)
    heavy = plant.with_servo(armature=plant.servo.armature + more)
    got, want = heavier(freeze(plant, pieces, FLOOR, PERIOD), more), freeze(heavy, pieces, FLOOR, PERIOD)
    np.testing.assert_allclose(got.mobility, want.mobility, rtol=1e-8, atol=1e-9 * want.mobility.max())
    np.testing.assert_allclose(got.free, want.free, rtol=1e-8, atol=1e-9 * np.abs(want.free).max())
