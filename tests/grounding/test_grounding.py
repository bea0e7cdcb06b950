from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from gsl.core.grounding import gain, ground, solve_action
from gsl.core.history import History
from gsl.core.layout import Layout
from gsl.errors import ConfigError
from gsl.grounding.ane import ActionNoise
from gsl.grounding.gat import REACH, ActionTransformation, LoadedTransformation
from gsl.grounding.none import NoGrounding
from gsl.models.forward import ForwardModel
from gsl.models.inverse import Regression, Solver
from gsl.models.network import Network

N = 3
LAYOUT = Layout(("a", "b", "c"), {"position": N, "velocity": N}, 0.02)
HISTORY = History(2)
SIZE = HISTORY.size(N)


def a_network(seed: int, *, hidden: int = 8) -> Network:
    rng = np.random.default_rng(seed)
    return Network(
        [
            (0.3 * rng.normal(size=(hidden, SIZE)), rng.normal(size=hidden)),
            (0.3 * rng.normal(size=(N, hidden)), np.zeros(N)),
        ]
    )


def a_model(seed: int) -> ForwardModel:
    return ForwardModel(a_network(seed), HISTORY, LAYOUT.joints)


def a_solver(seed: int, damping: float = 0.1) -> Solver:
    return Solver(a_model(seed), np.random.default_rng(seed).normal(size=(N, N)), damping)


def servo(rate: float) -> Network:
    """Joints that go a `rate` of the way to their target in each tick, x' = x + rate (a - x)."""
    weight = np.zeros((N, SIZE))
    weight[:, :N] = rate * np.eye(N)
    return Network([(weight, np.zeros(N))])


def inverse_servo(rate: float) -> Regression:
    return Regression(servo(1.0 / rate), HISTORY, LAYOUT.joints)


def sent(grounding: object, steps: int = 20, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    run = grounding.start(LAYOUT, np.random.default_rng(5))  # type: ignore[attr-defined]
    actions = 0.1 * rng.normal(size=(steps, N))
    return actions, np.array([run.transform(0.1 * rng.normal(size=LAYOUT.size), action) for action in actions])


def test_alpha_goes_from_the_agents_action_to_the_inverse() -> None:
    action, inverse = np.array([0.1, 0.2]), np.array([0.5, -0.2])
    np.testing.assert_array_equal(ground(action, inverse, 0.0), action)
    np.testing.assert_allclose(ground(action, inverse, 1.0), inverse)
    np.testing.assert_allclose(ground(action, inverse, 0.25), 0.75 * action + 0.25 * inverse)


def test_the_gain_solves_the_damped_least_squares() -> None:
    rng = np.random.default_rng(0)
    sensitivity, wanted, damping = rng.normal(size=(N, N)), rng.normal(size=N), 0.3
    ridge = damping * np.trace(sensitivity.T @ sensitivity) / N
    stacked = np.vstack([sensitivity, np.sqrt(ridge) * np.eye(N)])
    expected = np.linalg.lstsq(stacked, np.r_[wanted, np.zeros(N)], rcond=None)[0]
    np.testing.assert_allclose(gain(sensitivity, damping) @ wanted, expected)


def test_undamped_the_solved_action_has_the_wanted_effect() -> None:
    rng = np.random.default_rng(0)
    sensitivity, action, wanted = rng.normal(size=(N, N)), rng.normal(size=N), rng.normal(size=N)
    solution = solve_action(action, gain(sensitivity, 1e-12), wanted, sensitivity @ action)
    np.testing.assert_allclose(sensitivity @ solution, wanted)


@pytest.mark.parametrize("alpha", [0.3, 1.0])
@pytest.mark.parametrize("shared", [True, False])
def test_solving_is_the_identity_to_the_bit_when_sim_is_real(alpha: float, shared: bool) -> None:
    solver = a_solver(1)
    real = solver.simulator if shared else a_model(1)
    actions, grounded_actions = sent(LoadedTransformation(real, solver, alpha))
    np.testing.assert_array_equal(grounded_actions, actions)


def test_solving_is_not_the_identity_when_sim_is_not_real() -> None:
    actions, grounded_actions = sent(LoadedTransformation(a_model(2), a_solver(1), 1.0))
    assert np.abs(grounded_actions - actions).min() > 0.0


def test_a_perfect_regression_is_the_identity_when_sim_is_real() -> None:
    grounding = LoadedTransformation(ForwardModel(servo(0.4), HISTORY, LAYOUT.joints), inverse_servo(0.4))
    actions, grounded_actions = sent(grounding)
    np.testing.assert_allclose(grounded_actions, actions, atol=1e-7)


@pytest.mark.parametrize(
    "inverse", [inverse_servo(0.8), Solver(ForwardModel(servo(0.8), HISTORY, LAYOUT.joints), 0.8 * np.eye(N), 1e-9)]
)
def test_a_quick_servo_is_made_to_move_like_a_slow_one(inverse: Regression | Solver) -> None:
    """The paper's Fig. 6 in small: 0.8 (g - x) = 0.3 (a - x), so g = x + 3/8 (a - x)."""
    grounding = LoadedTransformation(ForwardModel(servo(0.3), HISTORY, LAYOUT.joints), inverse)
    x, action = np.array([0.1, -0.2, 0.0]), np.array([0.3, 0.1, -0.2])
    out = grounding.start(LAYOUT, np.random.default_rng(0)).transform(np.r_[x, np.zeros(N)], action)
    np.testing.assert_allclose(out, x + 0.375 * (action - x), atol=1e-6)


@pytest.mark.parametrize("inverse", [a_solver(1), inverse_servo(0.4)])
def test_alpha_zero_is_the_identity(inverse: Regression | Solver) -> None:
    actions, grounded_actions = sent(LoadedTransformation(a_model(2), inverse, 0.0))
    np.testing.assert_array_equal(grounded_actions, actions)


def test_the_forward_model_sees_the_agents_actions_and_the_inverse_those_carried_out() -> None:
    """The real robot follows its last action; the simulator, as the inverse knows, the present one."""
    delayed = np.zeros((N, SIZE))
    delayed[:, (2 + HISTORY.ticks) * N : (3 + HISTORY.ticks) * N] = np.eye(N)
    real = ForwardModel(Network([(delayed, np.zeros(N))]), HISTORY, LAYOUT.joints)
    actions, grounded_actions = sent(LoadedTransformation(real, inverse_servo(1.0)))
    np.testing.assert_allclose(grounded_actions[1:], actions[:-1], atol=1e-7)


def test_a_grounded_action_stays_within_reach() -> None:
    wild = ForwardModel(servo(100.0), HISTORY, LAYOUT.joints)
    actions, grounded_actions = sent(LoadedTransformation(wild, inverse_servo(0.1)))
    assert np.abs(grounded_actions - actions).max() == pytest.approx(REACH)


def test_every_episode_starts_afresh() -> None:
    grounding = LoadedTransformation(a_model(2), a_solver(1), noise=0.01)
    np.testing.assert_array_equal(sent(grounding)[1], sent(grounding)[1])
    np.testing.assert_array_equal(sent(pickle.loads(pickle.dumps(grounding)))[1], sent(grounding)[1])


def test_noise_has_the_stated_width() -> None:
    actions, noisy = sent(ActionNoise(sd=0.02), steps=4000)
    assert np.std(noisy - actions) == pytest.approx(0.02, rel=0.05)
    quiet, loud = (sent(LoadedTransformation(a_model(1), a_solver(1), noise=noise), 4000)[1] for noise in (0.0, 0.02))
    assert np.std(loud[0] - quiet[0]) > 0.0


@pytest.mark.parametrize("grounding", [NoGrounding(), ActionNoise(sd=0.0)])
def test_no_grounding_and_no_noise_are_the_identity(grounding: object) -> None:
    actions, grounded_actions = sent(grounding)
    np.testing.assert_array_equal(grounded_actions, actions)


def test_models_of_another_robot_are_refused() -> None:
    grounding = LoadedTransformation(a_model(1), a_solver(1))
    with pytest.raises(ConfigError, match="joints that the world lacks: c$"):
        grounding.start(Layout(("a", "b", "d"), LAYOUT.sizes, 0.02), np.random.default_rng(0))


def test_joints_that_the_models_do_not_know_get_the_agents_actions() -> None:
    f = ForwardModel(servo(0.3), HISTORY, LAYOUT.joints)
    whole = LoadedTransformation(f, inverse_servo(0.8))
    wide = Layout(("z", "c", "a", "y", "b"), {"position": 5, "velocity": 5}, 0.02)
    order, rng = [2, 4, 1], np.random.default_rng(3)
    run, among = (whole.start(layout, np.random.default_rng(0)) for layout in (LAYOUT, wide))
    for _ in range(4):
        x, action = rng.normal(size=5), rng.normal(size=5)
        expected = action.copy()
        expected[order] = run.transform(np.r_[x[order], np.zeros(N)], action[order])
        np.testing.assert_array_equal(among.transform(np.r_[x, np.zeros(5)], action), expected)
    shaken = replace(whole, noise=0.01).start(wide, np.random.default_rng(0))
    assert (shaken.transform(np.r_[x, np.zeros(5)], action) != action).all()  # noise on top is of the whole robot


def test_models_of_different_robots_do_not_go_together() -> None:
    other = Regression(servo(0.4), HISTORY, ("a", "b", "d"))
    config = ActionTransformation(forward_model="f", inverse_model="i", alpha=0.5)
    with pytest.raises(ConfigError, match="c, d"):
        config.load(lambda _: a_model(1), lambda _: other)


def test_models_that_look_ahead_differently_far_do_not_go_together() -> None:
    other = Regression(servo(0.4), HISTORY, LAYOUT.joints, horizon=2)
    config = ActionTransformation(forward_model="f", inverse_model="i")
    with pytest.raises(ConfigError, match="looks 2 ticks ahead, the forward model 1"):
        config.load(lambda _: a_model(1), lambda _: other)


@pytest.mark.parametrize(("alpha", "loaded"), [("auto", 1.0), (0.4, 0.4)])
def test_loading_keeps_alpha(alpha: float | str, loaded: float) -> None:
    config = ActionTransformation(forward_model="f", inverse_model="i", alpha=alpha)
    assert config.load(lambda _: a_model(1), lambda _: a_solver(1)).alpha == loaded


def test_alpha_beyond_one_is_refused() -> None:
    with pytest.raises(ValueError, match="less than or equal to 1"):
        ActionTransformation(forward_model="f", inverse_model="i", alpha=1.5)
