from __future__ import annotations

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from toy_plant import JOINTS, LAYOUT, QUICK, ToyEnv

from gsl.core.history import History
from gsl.grounding.ane import ActionNoise
from gsl.grounding.gat import LoadedTransformation
from gsl.grounding.none import NoGrounding
from gsl.models.forward import ForwardModel
from gsl.models.inverse import Solver
from gsl.models.network import Network
from gsl.worlds.grounded import GroundedEnv

ACTIONS = 0.3 * np.random.default_rng(0).normal(size=(30, 2))


def a_model(seed: int) -> ForwardModel:
    rng, history = np.random.default_rng(seed), History(2, ("gyro",))
    return ForwardModel(Network([(0.1 * rng.normal(size=(2, history.size(2))), np.zeros(2))]), history, JOINTS)


def a_transformation() -> LoadedTransformation:
    rng, history = np.random.default_rng(3), History(1)
    simulator = ForwardModel(Network([(0.1 * rng.normal(size=(2, history.size(2))), np.zeros(2))]), history, JOINTS)
    return LoadedTransformation(a_model(1), Solver(simulator, np.eye(2), 0.5), noise=0.01)


def run(env: GroundedEnv, seed: int | None, actions: np.ndarray = ACTIONS) -> tuple[np.ndarray, np.ndarray]:
    states, sent = [env.reset(seed=seed)[0]], []
    for action in actions:
        state, _, _, _, info = env.step(action)
        states.append(state)
        sent.append(info["grounded_action"])
    return np.array(states), np.array(sent)


@pytest.mark.filterwarnings("ignore:.*A Box observation space.*:UserWarning", "ignore:.*unwrapped.*:UserWarning")
@pytest.mark.parametrize("grounding", [NoGrounding(), ActionNoise(sd=0.02), a_transformation()])
def test_gymnasium_finds_no_fault(grounding: object) -> None:
    check_env(GroundedEnv(ToyEnv(QUICK), grounding), skip_render_check=True)  # type: ignore[arg-type]


@pytest.mark.parametrize("grounding", [ActionNoise(sd=0.02), a_transformation()])
def test_the_same_seed_gives_the_same_bytes_whatever_came_before(grounding: object) -> None:
    env = GroundedEnv(ToyEnv(QUICK), grounding)  # type: ignore[arg-type]
    first = run(env, 1)
    run(env, 2, ACTIONS[:3])
    again, fresh = run(env, 1), run(GroundedEnv(ToyEnv(QUICK), grounding), 1)  # type: ignore[arg-type]
    for walk in (again, fresh):
        assert [part.tobytes() for part in walk] == [part.tobytes() for part in first]


def test_another_seed_gives_other_noise() -> None:
    env = GroundedEnv(ToyEnv(QUICK), ActionNoise(sd=0.02))
    assert not np.array_equal(run(env, 1)[1], run(env, 2)[1])


def test_without_a_seed_the_episodes_differ() -> None:
    env = GroundedEnv(ToyEnv(QUICK), ActionNoise(sd=0.02))
    assert not np.array_equal(run(env, 1)[1], run(env, None)[1])


def test_no_grounding_leaves_the_world_as_it_is() -> None:
    bare, (states, sent) = ToyEnv(QUICK), run(GroundedEnv(ToyEnv(QUICK), NoGrounding()), 4)
    expected = [bare.reset(seed=4)[0], *(bare.step(action)[0] for action in ACTIONS)]
    np.testing.assert_array_equal(states, expected)
    np.testing.assert_array_equal(sent, ACTIONS)


def test_the_world_gets_the_grounded_action() -> None:
    states, sent = run(GroundedEnv(ToyEnv(QUICK), a_transformation()), 4)
    x = states[:, LAYOUT["position"]]
    np.testing.assert_allclose(np.diff(x, axis=0), QUICK * (sent - x[:-1]))
