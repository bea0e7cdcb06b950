"""The learned law: nothing where its weights are zero, named effects by hand, and the network against numpy."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import held, walked, world
from learned_servos import EVERYTHING, NAO, PERIOD, STEP, law, lawful, log, some_law, with_fields

from gsl.core.plant import Plant, nominal
from gsl.core.servo_law import HIDDEN, INPUTS, LAGS, LAYERS, NOBODY, SPEED_UNIT, act, network, no_law, weights
from gsl.worlds.bullet import BulletEnv
from gsl.worlds.held import Held, Windows
from gsl.worlds.servo import servo_torque
from gsl.worlds.servo_state import COMMANDS, first_state, pack

N = len(NAO.motors)
PLANTS = {"nominal": with_fields(NAO, {}), "everything": with_fields(NAO, EVERYTHING)}
SILENT = {"weights": 0.5}  # a last layer of zeros says nothing, whatever the hidden ones hold
GROUPS = np.arange(N) % 2


def torques(plant: Plant, steps: int = 60) -> np.ndarray:
    """Torques of servos whose joints are moved at random [N·m], shape (steps, N)."""
    rng, parameters = np.random.default_rng(0), pack(plant.servo, plant.robot.supply_voltage, plant.law)
    motion, rows = np.array([rng.uniform(-0.2, 0.2, N), rng.uniform(-2.0, 2.0, N)]), []
    state, torque = first_state(rng.uniform(-0.2, 0.2, (COMMANDS, N)), motion, STEP), np.empty(N)
    for k in range(steps):
        servo_torque(parameters, state, motion, k % 10 * STEP, STEP, PERIOD, torque)
        motion[1] += 0.2 * rng.standard_normal(N)
        motion[0] += STEP * motion[1]
        rows.append(torque.copy())
    return np.array(rows)


@pytest.fixture(scope="module")
def windows() -> Windows:
    cut = log(with_fields(NAO, {})).windows
    assert isinstance(cut, Windows)
    return cut


def replayed(plant: Plant, windows: Windows, load: np.ndarray | None = None) -> np.ndarray:
    return Held.of(plant, STEP, PERIOD).replay(windows, load)


@pytest.mark.parametrize("name", PLANTS)
def test_zero_weights_are_the_servo_itself_to_the_bit(name: str, windows: Windows) -> None:
    plant = PLANTS[name]
    silent = lawful(plant, law(plant, **SILENT))
    np.testing.assert_array_equal(torques(silent), torques(plant))
    np.testing.assert_array_equal(replayed(silent, windows), replayed(plant, windows))


@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.parametrize("floating", [True, False])
def test_zero_weights_are_the_servo_itself_in_bullet(name: str, floating: bool) -> None:
    where = world() if floating else held()
    settings = {} if name == "nominal" else {key: np.full(N, value) for key, value in EVERYTHING.items()}
    plant = where.plant.with_servo(**settings)
    envs = [BulletEnv(where, servo) for servo in (plant, lawful(plant, law(plant, **SILENT)))]
    seen = [walked(env, 0, 0.6) for env in envs]
    for env in envs:
        env.close()
    np.testing.assert_array_equal(seen[0], seen[1])


def test_a_law_matters_and_only_where_its_group_is() -> None:
    plant = with_fields(NAO, {})
    some = some_law(plant)
    of_one = some._replace(group=np.where(GROUPS == 0, GROUPS, NOBODY))
    bare, partly = torques(plant), torques(lawful(plant, of_one))
    np.testing.assert_array_equal(partly[:, GROUPS == 1], bare[:, GROUPS == 1])
    np.testing.assert_array_equal(partly[:, GROUPS == 0], torques(lawful(plant, some))[:, GROUPS == 0])
    assert (np.abs(partly - bare)[:, GROUPS == 0].max(axis=0) > 0.01 * plant.servo.limit[GROUPS == 0]).all()
    np.testing.assert_array_equal(torques(lawful(plant, no_law(N))), bare)


def test_the_layers_are_those_of_numpy() -> None:
    plant, rng = with_fields(NAO, {}), np.random.default_rng(0)
    some = law(plant, weights=0.7, last=0.5)
    for g in (0, 1):
        layers, x = np.zeros((LAYERS, HIDDEN)), rng.normal(size=INPUTS)
        layers[0, :INPUTS] = x
        got = network(weights(some), g, layers)
        inner = some.first_bias[g] + x @ some.first[g]
        outer = some.second_bias[g] + activated(inner) @ some.second[g]
        np.testing.assert_allclose(got, some.last_bias[g] + activated(outer) @ some.last[g], rtol=1e-12)
        hidden = [inner, outer, activated(inner), activated(outer)]
        np.testing.assert_allclose(layers[1:], hidden, rtol=1e-12, atol=1e-15)


def activated(z: np.ndarray) -> np.ndarray:
    z = np.clip(z, -3.0, 3.0)
    return z * (27.0 + z**2) / (27.0 + 9.0 * z**2)


def test_the_activation_is_nearly_tanh_odd_and_saturates() -> None:
    z = np.linspace(-6.0, 6.0, 1201)
    got = np.array([act(value) for value in z])
    assert np.abs(got - np.tanh(z)).max() < 0.025
    np.testing.assert_allclose(got, -got[::-1], rtol=0.0, atol=1e-14)
    assert (np.diff(got) >= 0.0).all() and act(3.0) == act(50.0) == 1.0


@pytest.mark.parametrize(("lag", "delay"), [(2, 0.02), (3, 0.03), (7, 0.07)])
def test_weights_on_an_older_target_are_a_latency(lag: int, delay: float, windows: Windows) -> None:
    plant = with_fields(NAO, {"offset": 0.02})
    shares = np.zeros((N, LAGS))
    shares[:, 0], shares[:, lag] = -1.0, 1.0
    learned = lawful(plant, law(plant)._replace(lag=shares))
    named = plant.with_servo(delay=np.full(N, delay))
    np.testing.assert_allclose(replayed(learned, windows), replayed(named, windows), rtol=0.0, atol=1e-11)
    assert np.abs(replayed(plant, windows) - replayed(named, windows)).max() > 1e-3


def test_a_share_of_the_gain_is_a_gain(windows: Windows) -> None:
    plant, shares = with_fields(NAO, {}), np.zeros((N, LAGS))
    shares[:, 0] = -0.4
    learned, named = lawful(plant, law(plant)._replace(lag=shares)), plant.with_servo(kp=0.6 * plant.servo.kp)
    np.testing.assert_allclose(replayed(learned, windows), replayed(named, windows), rtol=0.0, atol=1e-11)


def test_a_bias_before_the_limit_is_an_offset_and_one_behind_it_a_load(windows: Windows) -> None:
    plant = with_fields(NAO, {})
    biases = np.array([[0.05, 0.0], [-0.03, 0.0]])
    learned = lawful(plant, law(plant)._replace(last_bias=biases))
    named = plant.with_servo(offset=biases[GROUPS, 0] * plant.servo.limit / plant.servo.kp)
    np.testing.assert_allclose(replayed(learned, windows), replayed(named, windows), rtol=0.0, atol=1e-11)
    behind = lawful(plant, law(plant)._replace(last_bias=biases[:, ::-1].copy()))
    load = np.tile(biases[GROUPS, 0] * plant.servo.limit, (windows.length * round(PERIOD / STEP), 1))
    np.testing.assert_allclose(replayed(behind, windows), replayed(plant, windows, load), rtol=0.0, atol=1e-11)


def through(plant: Plant, column: int, gain: float) -> Plant:
    """The plant whose law subtracts `gain` times an input behind the limit, in the linear range of its network."""
    small, some = 1e-3, law(plant)
    first, second, last = np.zeros_like(some.first), np.zeros_like(some.second), np.zeros_like(some.last)
    first[:, column, 4], second[:, 4, 9] = small, 1.0
    last[0, 9, 1] = -gain / small
    torque = np.where(GROUPS == 0, 1.0, plant.servo.limit)
    return lawful(plant, some._replace(first=first, second=second, last=last, torque=torque))


def test_a_linear_output_is_viscous_friction(windows: Windows) -> None:
    plant, gain = with_fields(NAO, {}), 0.3
    named = plant.with_servo(viscous=np.where(GROUPS == 0, gain, 0.0))
    learned = through(plant, LAGS, gain * SPEED_UNIT)
    change = np.abs(replayed(named, windows) - replayed(plant, windows)).max()
    assert np.abs(replayed(learned, windows) - replayed(named, windows)).max() < 1e-4 * change


def test_an_output_of_the_bristle_is_dry_friction(windows: Windows) -> None:
    plant, size = with_fields(NAO, {}), 0.2
    named = plant.with_servo(coulomb=np.where(GROUPS == 0, size, 0.0))
    learned = through(plant, LAGS + 2, size)
    change = np.abs(replayed(named, windows) - replayed(plant, windows)).max()
    assert np.abs(replayed(learned, windows) - replayed(named, windows)).max() < 1e-4 * change


def test_a_law_of_another_plant_is_kept_by_effects() -> None:
    plant = nominal(NAO)
    some = some_law(plant)
    assert replace(plant, law=some).with_servo(coulomb=np.full(N, 0.1)).law is some
