"""The multi-step loss of a forward model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from commands import done, gsl, refused
from toy_plant import QUICK, SLOW, a_batch, an_episode

from gsl.core.console import Silent
from gsl.core.history import History
from gsl.errors import ConfigError
from gsl.grounding.gat import ActionTransformation
from gsl.models.config import FARTHEST, ModelConfig
from gsl.models.forward import ForwardModel
from gsl.models.free_run import TICKS as FREE
from gsl.models.free_run import predict_error, segments
from gsl.models.multi_step import MultiStep, measure_travel
from gsl.models.network import Network
from gsl.stages.train_forward import TrainForward
from gsl.stages.train_inverse import TrainInverse
from gsl.storage.models import FILES, FORWARD, INVERSE, read_forward_model, read_inverse_model
from gsl.storage.trajectories import write
from gsl.training.data import Parts
from gsl.training.forward import fit_forward
from gsl.validation.model_requirements import as_needed, looking_ahead

QUIET = Silent()
TICKS = 4


@pytest.mark.parametrize("history", [History(2), History(1, ("gyro",), 3)])
def test_the_loss_is_of_what_a_model_says_when_it_is_fed_with_its_own_answers(history: History) -> None:
    batch, rng = a_batch(SLOW, "real"), np.random.default_rng(3)
    pieces = segments(batch.episodes, history, carried_out=True, ticks=TICKS, every=1)
    layer = 0.1 * rng.standard_normal((2, history.size(2))), np.array([0.01, -0.02])
    model = ForwardModel(Network([layer]), history, batch.joints)
    errors = [predict_error(model, pieces._replace(ticks=tick)) for tick in range(1, TICKS + 1)]
    by_tick, scale = np.array([np.mean(error**2) for error in errors]), np.array([1.0, 2.0, 3.0, 4.0])
    weight, bias = (torch.as_tensor(part, dtype=torch.float32) for part in layer)
    loss = MultiStep(pieces, scale).loss(lambda windows: windows @ weight.T + bias)
    assert loss.item() == pytest.approx(np.mean(by_tick / scale), rel=1e-4)
    few = torch.arange(3)
    some = MultiStep(pieces, scale).loss(lambda windows: windows @ weight.T + bias, few)
    assert some.item() == pytest.approx(np.mean([np.mean(error[:3] ** 2) for error in errors] / scale), rel=1e-4)
    moved = measure_travel(pieces)
    assert len(moved) == TICKS and 0.0 < moved[0] < moved[1]


def test_it_brings_answers_that_are_fed_back_nearer_to_the_robot(tmp_path: Path) -> None:
    write(tmp_path / "real.parquet", a_batch(SLOW, "real", pi0=6, others=12))
    error = {}
    for ticks in (1, 10):
        (tmp_path / str(ticks)).mkdir()
        model = ModelConfig(family="mlp", hidden=(20,), epochs=15, multi_step=ticks)
        metrics = TrainForward(str(tmp_path / "real.parquet"), model).run(tmp_path / str(ticks), QUIET)
        error[ticks] = metrics["heldout"]["off_pi0"]["free_run_deg"]
    assert error[10] < 0.7 * error[1]


def test_a_grounding_asks_for_it_of_a_network() -> None:
    needed = as_needed(ModelConfig(), ActionTransformation("f", "i", multi_step=8))
    assert (needed.family, needed.multi_step) == ("mlp", 8)
    assert {name: variant.multi_step for name, variant in ModelConfig(multi_step=8).variants.items()} == {
        "linear": 1,
        "mlp": 8,
    }


def test_models_of_a_late_simulator_are_fitted_without_it() -> None:
    late = looking_ahead(ModelConfig(family="mlp", multi_step=8), extra=2)
    assert (late.horizon, late.multi_step) == (3, 1)


FED_BACK = "answers that are fed back are likelihood=point; or multi_step=1"


@pytest.mark.parametrize(
    ("typed", "line"),
    [
        (
            ("iterate", "grounding=gat_multi_step", "forward_model.likelihood=gaussian"),
            f"forward_model.likelihood = gaussian: {FED_BACK}",
        ),
        (
            ("iterate", "grounding=gat", "inverse_model.multi_step=5", "inverse_model.family=mlp"),
            "inverse_model.multi_step = 5: is of a forward model",
        ),
        (
            ("iterate", "grounding=gat_residual", "forward_model.multi_step=5"),
            "forward_model.multi_step = 5: is of a model that corrects none",
        ),
        (
            ("reproduce", "fig6", "grounding@iterate.grounding=gat_multi_step", "iterate.forward_model.sensors=[]")
            + ("iterate.forward_model.likelihood=gaussian",),
            f"iterate.forward_model.likelihood = gaussian: {FED_BACK}",
        ),
        (
            ("reproduce", "budget", "grounding@methods.gat=gat_14", "methods.gat.x=[LNeck]"),
            "methods.gat.x = LNeck: the models know no joint of this name",
        ),
        (
            ("iterate", "experiment=gymnasium", "sim.env_id=CartPole-v1", "real.env_id=CartPole-v1", "grounding=gat")
            + ("forward_model.multi_step=5", "forward_model.family=mlp"),
            "forward_model.multi_step: is for robots; a gymnasium environment's state is observed whole",
        ),
    ],
)
def test_what_cannot_be_is_said_before_anything_is_asked_of_the_robot(
    typed: tuple[str, ...], line: str, tmp_path: Path
) -> None:
    said = gsl(*typed, "preset=toy", folder=tmp_path)
    assert said.code == 2 and f": {line}" in said.lines[-1]
    assert not list(tmp_path.rglob("trajectories.parquet"))


def test_a_model_tells_over_how_many_ticks_it_was_fitted_and_no_other_serves(tmp_path: Path) -> None:
    write(tmp_path / "real.parquet", a_batch(SLOW, "real"))
    write(tmp_path / "sim.parquet", a_batch(QUICK, "sim", noise=0.02))
    TrainInverse(str(tmp_path / "sim.parquet"), ModelConfig("linear"), method="solve").run(tmp_path, QUIET)
    few: dict[str, Any] = {"family": "mlp", "hidden": (4,), "epochs": 1}
    for ticks, members in ((1, 1), (3, 1), (3, 2)):
        model = ModelConfig(multi_step=ticks, members=members, **few)
        TrainForward(str(tmp_path / "real.parquet"), model).run(tmp_path, QUIET)
        asked = ActionTransformation(*(str(tmp_path / FILES[kind]) for kind in (FORWARD, INVERSE)), multi_step=3)
        if ticks == 1:
            with pytest.raises(
                ConfigError, match="was not fitted to its own answers of 3 ticks; train it with model=mlp"
            ):
                asked.load(read_forward_model, read_inverse_model)
        else:
            assert asked.load(read_forward_model, read_inverse_model).forward.multi_step == 3


def test_a_member_whose_draw_is_over_at_once_is_fitted_to_single_ticks() -> None:
    batch = a_batch(SLOW, "real", pi0=2, others=2)
    over = tuple(an_episode(SLOW, seed, steps=8) for seed in range(4))
    parts = Parts(replace(batch, episodes=over), batch, batch)
    model, _ = fit_forward(ModelConfig(family="mlp", hidden=(4,), epochs=1, multi_step=10), parts, 1)
    assert np.isfinite(model.effects(np.zeros((1, model.network.inputs)))).all()


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        ({"likelihood": "gaussian"}, "likelihood = gaussian: answers that are fed back are likelihood=point"),
        ({"encoding": "sincos"}, "encoding = sincos: answers that are fed back are encoding=plain"),
        ({"horizon": 2}, "horizon = 2: answers that are fed back are horizon=1"),
        ({"family": "linear"}, "multi_step = 5: is for an MLP"),
    ],
)
def test_answers_that_cannot_be_fed_back_are_refused(settings: dict[str, Any], line: str) -> None:
    with pytest.raises(ConfigError) as caught:
        ModelConfig(multi_step=5, **settings)
    assert str(caught.value).startswith(line)


def test_it_is_of_a_forward_model_that_corrects_nothing(tmp_path: Path) -> None:
    for more in ({"residual": True}, {"predicts": "gaussian"}):
        with pytest.raises(ConfigError, match="multi_step = 5: is of a network that predicts a point"):
            ActionTransformation("f", "i", multi_step=5, **more)
    write(tmp_path / "sim.parquet", a_batch(QUICK, "sim", noise=0.02))
    write(tmp_path / "real.parquet", a_batch(SLOW, "real"))
    with pytest.raises(ConfigError, match="multi_step = 5: is of a forward model"):
        TrainInverse(str(tmp_path / "sim.parquet"), ModelConfig(multi_step=5)).run(tmp_path, QUIET)
    TrainInverse(str(tmp_path / "sim.parquet"), ModelConfig("linear"), method="solve").run(tmp_path, QUIET)
    inverse = str(tmp_path / "inverse_model.safetensors")
    with pytest.raises(ConfigError, match="multi_step = 5: is of a model that corrects none"):
        TrainForward(str(tmp_path / "real.parquet"), ModelConfig(multi_step=5), inverse).run(tmp_path, QUIET)


def test_it_is_one_setting_of_the_command(tmp_path: Path) -> None:
    write(tmp_path / "real.parquet", a_batch(SLOW, "real"))
    output = done("train-forward", "data=real.parquet", "model=mlp", "model.multi_step=3", folder=tmp_path)
    assert "forward model (mlp) on held-out real trajectories" in output.out
    said = refused("train-forward", "data=real.parquet", "model.multi_step=30", folder=tmp_path)
    assert said == "model.multi_step = 30: must be at most 10"
    assert FARTHEST <= FREE  # what an episode has to be long enough for
