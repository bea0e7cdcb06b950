from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gsl.core.checkpoint import read_checkpoint
from gsl.core.history import History
from gsl.errors import ArtifactError
from gsl.models.choice import best, fit_network
from gsl.models.config import ModelConfig
from gsl.models.forward import ForwardModel
from gsl.models.inverse import Regression, Solver
from gsl.models.linear import fit_linear
from gsl.models.network import Network
from gsl.storage.checkpoints import write_checkpoint
from gsl.storage.models import FILES, read_forward_model, read_inverse_model, write_model

RNG = np.random.default_rng(0)
JOINTS = ("a", "b")
HISTORY = History(1, ("gyro",))
SIZE = HISTORY.size(2)
QUICK = ModelConfig(hidden=(24, 16), epochs=25, rate=3e-3, batch=64, decay=0.0)


def a_network(inputs: int = SIZE, outputs: int = 2, hidden: tuple[int, ...] = (5, 4)) -> Network:
    widths = (inputs, *hidden, outputs)
    return Network(
        [(RNG.normal(size=(m, n)), RNG.normal(size=m)) for n, m in zip(widths[:-1], widths[1:], strict=True)]
    )


def by_hand(network: Network, features: np.ndarray) -> np.ndarray:
    values = features
    for weight, bias in network.layers[:-1]:
        values = np.tanh(weight @ values + bias)
    return network.layers[-1][0] @ values + network.layers[-1][1]


@pytest.mark.parametrize("hidden", [(), (5,), (5, 4)])
def test_acting_computes_the_formula_for_one_sample_as_for_many(hidden: tuple[int, ...]) -> None:
    network, features = a_network(hidden=hidden), RNG.normal(size=(7, SIZE))
    one_by_one = [network.predict(row) for row in features]
    np.testing.assert_allclose(one_by_one, [by_hand(network, row) for row in features], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(network.predict_many(features), one_by_one, rtol=1e-5, atol=1e-5)


def test_an_answer_stays_when_the_next_is_given() -> None:
    network = a_network()
    first = network.predict(np.ones(SIZE))
    before = first.copy()
    network.predict(np.zeros(SIZE))
    np.testing.assert_array_equal(first, before)


def test_a_pickled_network_answers_to_the_bit() -> None:
    network, features = a_network(), RNG.normal(size=SIZE)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(network)).predict(features), network.predict(features))


def test_the_linear_model_finds_a_linear_law_whatever_the_units() -> None:
    weight, bias = RNG.normal(size=(3, 4)), RNG.normal(size=3)
    inputs = RNG.normal(size=(200, 4)) * np.array([1e-2, 1.0, 50.0, 1.0]) + np.array([0.0, 3.0, -100.0, 0.0])
    network = fit_linear(inputs, inputs @ weight.T + bias, ridge=1e-9)
    np.testing.assert_allclose(network.layers[0][0], weight, rtol=1e-4)
    np.testing.assert_allclose(network.layers[0][1], bias, rtol=1e-3, atol=1e-3)


def test_the_ridge_keeps_collinear_inputs_in_bounds() -> None:
    column = RNG.normal(size=(100, 1))
    network = fit_linear(np.hstack([column, column]), column, ridge=1e-3)
    np.testing.assert_allclose(network.layers[0][0], [[0.5, 0.5]], atol=1e-3)


def bent(count: int) -> tuple[np.ndarray, np.ndarray]:
    inputs = RNG.normal(size=(count, 2))
    return inputs, np.column_stack([np.abs(inputs[:, 0]), inputs[:, 0] * inputs[:, 1]])


def test_an_mlp_fits_what_a_line_cannot_and_auto_notices() -> None:
    training, validation, unseen = bent(1000), bent(200), bent(200)

    def error(network: Network) -> float:
        return float(np.mean((network.predict_many(unseen[0]) - unseen[1]) ** 2))

    network, choice = best(QUICK, lambda config, _: fit_network(training, validation, config, seed=1), error)
    assert choice.config.family == "mlp"
    assert error(network) == choice.scores["mlp"] < 0.2 * choice.scores["linear"]


def test_what_is_compared_has_not_seen_validation_and_a_chosen_line_learns_from_it() -> None:
    training, validation = ((x := RNG.normal(size=(count, 2)), x @ [[1.0], [2.0]]) for count in (30, 20))
    fitted: list[bool] = []

    def fit(config: ModelConfig, whole: bool) -> Network:
        fitted.append(whole)
        return fit_network(training, validation, config, seed=1, whole=whole)

    def error(network: Network) -> float:
        return float(np.mean((network.predict_many(validation[0]) - validation[1]) ** 2))

    network, choice = best(replace(QUICK, ridge=0.1), fit, error)
    both = tuple(np.concatenate(pair) for pair in zip(training, validation, strict=True))
    assert choice.config.family == "linear" and fitted == [False, False, True]
    np.testing.assert_array_equal(network.layers[0][0], fit_linear(*both, ridge=0.1).layers[0][0])
    assert choice.scores["linear"] == error(fit_linear(*training, ridge=0.1))
    assert not replace(choice.config, members=5).learns_from_all
    assert not replace(choice.config, likelihood="gaussian").learns_from_all


def test_the_same_seed_fits_the_same_weights_and_leaves_torch_alone() -> None:
    import torch

    training, validation, brief = bent(200), bent(50), ModelConfig("mlp", hidden=(8,), epochs=2)
    state = torch.get_rng_state()
    first, again, other = (fit_network(training, validation, brief, seed=seed) for seed in (1, 1, 2))
    assert torch.equal(state, torch.get_rng_state())
    np.testing.assert_array_equal(first.layers[0][0], again.layers[0][0])
    assert not np.array_equal(first.layers[0][0], other.layers[0][0])


@pytest.mark.parametrize("encoding", ["plain", "sincos"])
def test_a_forward_model_comes_back_from_its_file(tmp_path: Path, encoding: str) -> None:
    model = ForwardModel(a_network(outputs=2 if encoding == "plain" else 4), HISTORY, JOINTS, encoding, 2)
    again = read_forward_model(str(write_model(tmp_path, model)))
    assert (again.history, again.joints, again.encoding, again.horizon) == (HISTORY, JOINTS, encoding, 2)
    window = RNG.normal(size=SIZE)
    np.testing.assert_array_equal(again.effect(window), model.effect(window))


@pytest.mark.parametrize("method", ["regression", "solve"])
def test_an_inverse_model_comes_back_from_its_file(tmp_path: Path, method: str) -> None:
    history = History(1)
    network = a_network(inputs=history.size(2))
    regression = Regression(network, history, JOINTS, "plain")
    solver = Solver(ForwardModel(network, history, JOINTS), RNG.normal(size=(2, 2)), 0.3)
    model = regression if method == "regression" else solver
    again = read_inverse_model(str(write_model(tmp_path, model)))
    window, action, wanted = RNG.normal(size=history.size(2)), RNG.normal(size=2), RNG.normal(size=2)
    np.testing.assert_array_equal(
        again.action(window.copy(), action, wanted), model.action(window.copy(), action, wanted)
    )


@pytest.mark.parametrize("method", ["regression", "solve"])
def test_one_action_is_as_many(method: str) -> None:
    history = History(1)
    network = a_network(inputs=history.size(2))
    solver = Solver(ForwardModel(network, history, JOINTS), RNG.normal(size=(2, 2)), 0.3)
    model = Regression(network, history, JOINTS) if method == "regression" else solver
    windows, actions, wanted = RNG.normal(size=(5, history.size(2))), RNG.normal(size=(5, 2)), RNG.normal(size=(5, 2))
    many = model.actions(windows, actions, wanted)
    one_by_one = [model.action(*row) for row in zip(windows.copy(), actions, wanted, strict=True)]
    np.testing.assert_allclose(many, one_by_one, rtol=1e-4, atol=1e-5)


def test_a_forward_model_is_no_inverse_model(tmp_path: Path) -> None:
    path = write_model(tmp_path, ForwardModel(a_network(), HISTORY, JOINTS))
    with pytest.raises(ArtifactError, match="holds forward_model, but inverse_model is needed"):
        read_inverse_model(str(path))


def test_a_checkpoint_without_a_layer_is_refused(tmp_path: Path) -> None:
    path = write_model(tmp_path, ForwardModel(a_network(), HISTORY, JOINTS))
    arrays, about = read_checkpoint(path, kind="forward_model")
    del arrays["layer_1.weight"]
    write_checkpoint(tmp_path / FILES["forward_model"], arrays, about)
    with pytest.raises(ArtifactError, match="train it again"):
        read_forward_model(str(path))
