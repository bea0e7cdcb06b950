"""Forward models that say a distribution, ensembles that know where they know nothing, and groundings with both."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gsl.core.draws import Draws
from gsl.core.history import History
from gsl.core.layout import Layout
from gsl.core.scaling import scaling
from gsl.errors import ConfigError
from gsl.grounding.gat import ActionTransformation, LoadedTransformation
from gsl.models.calibration import calibrate, mixing
from gsl.models.choice import fit_network
from gsl.models.config import ModelConfig
from gsl.models.ensemble import Ensemble, ensemble
from gsl.models.forward import ForwardModel
from gsl.models.head import Head
from gsl.models.inverse import Solver
from gsl.models.network import Network, unscale
from gsl.storage.models import read_forward_model, write_model

JOINTS, HISTORY = ("a", "b"), History(1)
SIZE, N = HISTORY.size(2), 2
GAUSSIAN, MIXTURE = Head("gaussian"), Head("mixture", 3)
HEADS = pytest.mark.parametrize("head", [Head(), GAUSSIAN, MIXTURE], ids=lambda head: head.likelihood)
QUICK = ModelConfig("mlp", hidden=(24,), epochs=60, rate=5e-3, batch=64, decay=0.0)


def a_network(head: Head, seed: int = 0) -> Network:
    rng = np.random.default_rng(seed)
    return Network([(0.2 * rng.normal(size=(head.width(N), SIZE)), 0.5 * rng.normal(size=head.width(N)))])


def a_model(head: Head, seed: int = 0) -> ForwardModel:
    return ForwardModel(a_network(head, seed), HISTORY, JOINTS, head=head)


def certain(model: ForwardModel) -> ForwardModel:
    """The same Gaussian with no variance."""
    weight, bias = model.network.layers[-1]
    quiet = Network([(np.vstack([weight[:N], np.zeros_like(weight[N:])]), np.r_[bias[:N], np.full(N, -np.inf)])])
    return replace(model, network=quiet)


@HEADS
def test_widths_and_sizes_belong_together(head: Head) -> None:
    assert head.size(head.width(7)) == 7


@pytest.mark.parametrize("head", [GAUSSIAN, MIXTURE], ids=lambda head: head.likelihood)
def test_draws_have_the_moments_that_the_outputs_say(head: Head) -> None:
    draws, raw = Draws(np.random.default_rng(0)), np.random.default_rng(1).normal(size=head.width(N))
    weights, means, sds = head.parts(raw)
    drawn = np.array([head.draw(raw, draws) for _ in range(20000)])
    second = (weights[:, None] * (sds**2 + means**2)).sum(axis=0)
    np.testing.assert_allclose(drawn.mean(axis=0), head.expect(raw), atol=0.05)
    np.testing.assert_allclose((drawn**2).mean(axis=0), second, rtol=0.06)


@pytest.mark.parametrize("head", [GAUSSIAN, MIXTURE], ids=lambda head: head.likelihood)
def test_the_likelihood_is_a_density(head: Head) -> None:
    raw = 0.5 * np.random.default_rng(1).normal(size=head.width(1))
    grid = np.linspace(-30.0, 30.0, 20001)
    density = np.exp(-head.surprise(np.tile(raw, (len(grid), 1)), grid[:, None]))
    assert np.trapezoid(density, grid) == pytest.approx(1.0, abs=1e-4)


@HEADS
def test_raw_outputs_of_scaled_targets_are_those_of_plain_ones(head: Head) -> None:
    values = np.random.default_rng(0).normal(size=(50, N)) * [0.1, 3.0] + [5.0, -1.0]
    outputs = scaling(values)
    network, x = a_network(head), np.random.default_rng(2).normal(size=(4, SIZE))
    as_they_are = scaling(np.zeros((2, SIZE)))
    plain = unscale(list(network.layers), as_they_are, head.scaling(outputs))
    wanted = outputs.undo(head.expect(network.predict_many(x)))
    np.testing.assert_allclose(head.expect(plain.predict_many(x)), wanted, rtol=1e-4)
    if head.draws:
        sds = [head.parts(net.predict_many(x))[2] for net in (network, plain)]
        np.testing.assert_allclose(sds[1], sds[0] * outputs.sd, rtol=1e-4)


def uneven(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Noise that grows with |x|: sd .1 at 0, .6 at either end."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.0, 1.0, size=(count, 1))
    return x, x + (0.1 + 0.5 * np.abs(x)) * rng.normal(size=(count, 1))


def test_a_gaussian_learns_where_it_is_noisy_and_a_linear_one_how_noisy_it_is() -> None:
    config, unseen = replace(QUICK, likelihood="gaussian"), np.array([[0.3], [0.9]])
    network = fit_network(uneven(4000, 0), uneven(500, 1), config, seed=1, head=GAUSSIAN)
    sds = GAUSSIAN.parts(network.predict_many(unseen))[2][:, 0, 0]
    np.testing.assert_allclose(sds, [0.25, 0.55], rtol=0.15)
    flat = fit_network(uneven(4000, 0), uneven(500, 1), replace(config, family="linear"), seed=1, head=GAUSSIAN)
    x, y = uneven(4000, 0)
    assert np.ptp(GAUSSIAN.parts(flat.predict_many(x))[2]) == 0.0
    assert np.exp(flat.predict_many(x)[0, 1]) == pytest.approx((y - x).std(), rel=0.05)


def test_beta_keeps_a_gaussian_s_mean_where_the_likelihood_takes_it_for_noise() -> None:
    rng = np.random.default_rng(0)
    inputs = rng.uniform(-1.0, 1.0, (3000, 1))
    targets = np.where(inputs > 0.0, np.sin(5.0 * inputs), 0.05 * inputs)  # hard on the right, easy on the left
    left = {}
    for beta in (0.0, 0.5):
        config = ModelConfig(family="mlp", likelihood="gaussian", hidden=(32, 32), beta=beta)
        parts = (inputs[:2400], targets[:2400]), (inputs[2400:], targets[2400:])
        network = fit_network(*parts, config, seed=1, head=config.head)
        errors = config.head.expect(network.predict_many(inputs[2400:])) - targets[2400:]
        left[beta] = errors.var() / targets[2400:].var()
    assert left[0.5] < 0.01 < 0.5 < left[0.0]


def forked(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, 1)), np.sign(rng.normal(size=(count, 1))) + 0.05 * rng.normal(size=(count, 1))


def test_a_mixture_learns_what_goes_either_way() -> None:
    config, head = replace(QUICK, likelihood="mixture", components=2), Head("mixture", 2)
    network = fit_network(forked(2000, 0), forked(400, 1), config, seed=1, head=head)
    draws, raw = Draws(np.random.default_rng(0)), network.predict(np.zeros(1))
    drawn = np.array([head.draw(raw, draws)[0] for _ in range(2000)])
    assert (np.abs(np.abs(drawn) - 1.0) < 0.3).mean() > 0.98
    assert (drawn > 0.0).mean() == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize("head", [GAUSSIAN, MIXTURE], ids=lambda head: head.likelihood)
def test_calibration_finds_how_wide_errors_are_and_how_long_they_last(head: Head) -> None:
    rng, count, memory = np.random.default_rng(0), 3000, np.array([0.0, 0.6])
    network, drawn = a_network(head), Draws(rng, memory)
    inputs = rng.normal(size=(count, SIZE))
    raw = network.predict_many(inputs)
    weights, means, sds = head.parts(raw)
    expected = head.expect(raw)
    sd = np.sqrt((weights[..., None] * (sds**2 + (means - expected[:, None]) ** 2)).sum(axis=-2))
    outputs = expected + [1.5, 0.8] * sd * np.array([drawn.normal(N) for _ in range(count)])
    parts = [(inputs[k : k + 300], outputs[k : k + 300]) for k in range(0, count, 300)]
    wider, lasting = calibrate(network, head, parts)
    np.testing.assert_allclose(lasting, memory, atol=0.06)
    np.testing.assert_array_equal(head.expect(wider.predict_many(inputs)), expected)
    scale = head.parts(wider.predict_many(inputs))[2] / sds
    np.testing.assert_allclose(scale, np.broadcast_to([1.5, 0.8], scale.shape), rtol=0.06)


def test_a_joint_that_is_quite_still_has_no_memory() -> None:
    network, rng = a_network(GAUSSIAN), np.random.default_rng(0)
    inputs = rng.normal(size=(300, SIZE))
    outputs = GAUSSIAN.expect(network.predict_many(inputs))
    outputs[:, 0] += rng.normal(size=300)
    _, memory = calibrate(network, GAUSSIAN, [(inputs, outputs)])
    assert memory[1] == 0.0 and np.isfinite(memory).all()


def test_a_linear_mixture_is_refused() -> None:
    with pytest.raises(ConfigError, match="a linear model has no mixture"):
        ModelConfig(family="linear", likelihood="mixture")


@pytest.mark.parametrize("head", [GAUSSIAN, MIXTURE], ids=lambda head: head.likelihood)
def test_a_stochastic_model_and_an_ensemble_come_back_from_their_files(tmp_path: Path, head: Head) -> None:
    single, windows = a_model(head), np.random.default_rng(3).normal(size=(50, SIZE))
    for model in (single, ensemble((single, a_model(head, 1)), windows)):
        again = read_forward_model(str(write_model(tmp_path, model)))
        assert type(again) is type(model)
        np.testing.assert_array_equal(again.effect(windows[0]), model.effect(windows[0]))
        first, second = (member.effect(windows[0], Draws(np.random.default_rng(0))) for member in (again, model))
        np.testing.assert_array_equal(first, second)


def in_a_run(grounding: LoadedTransformation, far: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    rng, layout = np.random.default_rng(0), Layout(JOINTS, {"position": N, "velocity": N}, 0.02)
    run, actions = grounding.start(layout, np.random.default_rng(5)), 0.01 * rng.normal(size=(20, N))
    seen = 0.01 * far * rng.normal(size=(20, 2 * N))
    return actions, np.array([run.transform(*pair).copy() for pair in zip(seen, actions, strict=True)])


SOLVER = Solver(a_model(Head(), 7), np.random.default_rng(4).normal(size=(N, N)), 0.3)


def test_sgat_without_variance_is_gat_to_the_bit() -> None:
    gat = LoadedTransformation(certain(a_model(GAUSSIAN)), SOLVER)
    sgat = replace(gat, draws=True)
    np.testing.assert_array_equal(in_a_run(sgat)[1], in_a_run(gat)[1])


def test_gat_with_a_gaussian_is_its_mode_and_sgat_scatters_about_it() -> None:
    gat = LoadedTransformation(a_model(GAUSSIAN), SOLVER)
    sure = LoadedTransformation(certain(a_model(GAUSSIAN)), SOLVER)
    np.testing.assert_array_equal(in_a_run(gat)[1], in_a_run(sure)[1])
    assert np.abs(in_a_run(replace(gat, draws=True))[1] - in_a_run(gat)[1]).min() > 0.0


def members() -> Ensemble:
    """Two models that agree at rest and the less the farther a window is from it."""
    both = [a_model(Head(), seed) for seed in (0, 1)]
    still = [Network([(model.network.layers[0][0], np.full(N, 0.1))]) for model in both]
    windows = 0.01 * np.random.default_rng(3).normal(size=(200, SIZE))
    return ensemble(tuple(replace(model, network=net) for model, net in zip(both, still, strict=True)), windows)


def test_a_gate_leaves_actions_alone_where_the_ensemble_knows_nothing() -> None:
    committee, open_gate = members(), LoadedTransformation(members(), SOLVER)
    gated = replace(open_gate, gate=1.0)
    actions, sent = in_a_run(gated, far=1000.0)
    np.testing.assert_array_equal(sent[5:], actions[5:])
    generous = replace(open_gate, gate=1e6)
    np.testing.assert_array_equal(in_a_run(generous)[1], in_a_run(open_gate)[1])
    windows = 0.01 * np.random.default_rng(8).normal(size=(500, SIZE))
    assert (np.array([committee.judge(window)[1] for window in windows]) < 1.0).mean() == pytest.approx(0.95, abs=0.03)


def test_what_a_model_cannot_do_is_refused() -> None:
    settings = ActionTransformation(forward_model="f", inverse_model="i", predicts="gaussian")
    with pytest.raises(ConfigError, match="predicts a point; train it with model.likelihood=gaussian"):
        settings.load(lambda _: a_model(Head()), lambda _: SOLVER)
    with pytest.raises(ConfigError, match="needs an ensemble"):
        replace(settings, predicts="point", gate=1.0).load(lambda _: a_model(Head()), lambda _: SOLVER)


def test_variables_that_one_noise_moves_are_drawn_together() -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(5000, 1))
    outputs = np.hstack([noise, -2.0 * noise, 0.5 * rng.normal(size=(5000, 1))])
    head = Head("gaussian")
    raw = np.concatenate([np.zeros(3), np.log([1.0, 2.0, 0.5])])
    network = Network([(np.zeros((6, 1)), raw)])
    factor = mixing(network, head, (np.zeros((5000, 1)), outputs))
    draws = Draws(np.random.default_rng(1))
    drawn = np.array([head.draw(raw, draws, factor) for _ in range(5000)])
    np.testing.assert_allclose(drawn.std(axis=0), [1.0, 2.0, 0.5], rtol=0.05)
    np.testing.assert_allclose(drawn[:, 1], -2.0 * drawn[:, 0], atol=0.05)
    assert abs(np.corrcoef(drawn[:, 0], drawn[:, 2])[0, 1]) < 0.05
