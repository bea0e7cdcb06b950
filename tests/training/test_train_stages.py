from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chains import read_iterate, train
from commands import gsl, refused
from toy_plant import LAYOUT, QUICK, SLOW, ToyEnv, a_batch

from gsl.core.console import Silent
from gsl.core.transitions import transitions
from gsl.errors import ConfigError, TrajectoryError
from gsl.grounding.gat import ActionTransformation, LoadedTransformation
from gsl.models.config import HISTORIES, ModelConfig
from gsl.models.ensemble import Ensemble
from gsl.models.linear import fit_linear
from gsl.stages.train_forward import TrainForward
from gsl.stages.train_inverse import TrainInverse
from gsl.storage.models import read_forward_model, read_inverse_model
from gsl.storage.trajectories import read, write
from gsl.training.data import HELDOUT, labels
from gsl.worlds.grounded import GroundedEnv

pytestmark = pytest.mark.slow

QUIET = Silent()
LINEAR = ModelConfig(family="linear", ridge=1e-6)


@pytest.fixture
def real(tmp_path: Path) -> str:
    write(tmp_path / "real.parquet", a_batch(SLOW, "real"))
    return str(tmp_path / "real.parquet")


@pytest.fixture
def sim(tmp_path: Path) -> str:
    write(tmp_path / "sim.parquet", a_batch(QUICK, "sim", noise=0.02))
    return str(tmp_path / "sim.parquet")


def test_the_forward_model_is_measured_on_trajectories_of_both_groups_that_it_has_not_seen(
    real: str, tmp_path: Path
) -> None:
    metrics = TrainForward(data=real, model=LINEAR).run(tmp_path, QUIET)
    heldout = read(tmp_path / HELDOUT)
    assert "pi0" in labels(heldout)
    assert set(labels(heldout)) != {"pi0"}
    assert metrics["trajectories"] + len(heldout) == len(read(Path(real)))
    for group in ("pi0", "off_pi0"):
        measured = metrics["heldout"][group]
        assert measured["one_step_deg"] < 1e-3 < measured["one_step_no_change_deg"]
        assert measured["free_run_deg"] < 1e-2 < measured["free_run_no_change_deg"]
        assert measured["r2"] > 0.9999
        assert measured["one_step_by_joint_deg"].keys() == {"LHipPitch", "LKneePitch"}


def test_a_linear_plant_needs_no_mlp(real: str, tmp_path: Path) -> None:
    model = ModelConfig(hidden=(8,), epochs=3)
    assert TrainForward(data=real, model=model).run(tmp_path, QUIET)["family"] == "linear"


@pytest.mark.parametrize("model", [LINEAR, ModelConfig(family="mlp", hidden=(8,), epochs=2)])
def test_the_same_seed_writes_the_same_bytes(real: str, tmp_path: Path, model: ModelConfig) -> None:
    written = []
    for name in ("first", "again"):
        (tmp_path / name).mkdir()
        TrainForward(data=real, model=model).run(tmp_path / name, QUIET)
        written.append([(tmp_path / name / file).read_bytes() for file in (HELDOUT, "forward_model.safetensors")])
    assert written[0] == written[1]


@pytest.mark.parametrize("horizon", [1, 2])
@pytest.mark.parametrize("encoding", ["plain", "sincos"])
def test_every_encoding_and_horizon_predicts(real: str, tmp_path: Path, encoding: str, horizon: int) -> None:
    model = ModelConfig(family="linear", encoding=encoding, horizon=horizon, sensors=("gyro",))
    measured = TrainForward(data=real, model=model).run(tmp_path, QUIET)["heldout"]["off_pi0"]
    assert measured["one_step_deg"] < 0.2 * measured["one_step_no_change_deg"]


def test_draws_are_calibrated_unless_they_are_to_be_as_fitted(real: str, tmp_path: Path) -> None:
    widths, memories = [], []
    for calibrated in (True, False):
        model = replace(LINEAR, likelihood="gaussian", history=0, calibrated=calibrated)  # a slow plant's errors last
        TrainForward(data=real, model=model).run(tmp_path, QUIET)
        f = read_forward_model(str(tmp_path / "forward_model.safetensors"))
        widths.append(f.head.parts(f.network.predict(np.zeros(f.network.inputs)))[2])
        memories.append(f.memory)
    assert np.all(memories[0] > 0.0) and not np.any(memories[1])
    assert not np.allclose(*widths)


def test_trajectories_of_earlier_policies_are_learned_from_and_held_out_of_nothing(real: str, tmp_path: Path) -> None:
    before = tmp_path / "before.parquet"
    write(before, a_batch(SLOW, "real", pi0=2, others=2))
    alone = TrainForward(data=real, model=LINEAR).run(tmp_path, QUIET)
    heldout = (tmp_path / HELDOUT).read_bytes()
    stage = TrainForward(data=real, model=LINEAR, earlier=(str(before),))
    assert stage.parents() == {"data": Path(real), "earlier_1": before}
    assert stage.run(tmp_path, QUIET)["trajectories"] == alone["trajectories"] + 4
    assert (tmp_path / HELDOUT).read_bytes() == heldout


def test_earlier_trajectories_are_of_the_same_robot_and_not_those_that_are_held_out(
    real: str, sim: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match="the same trajectories twice"):
        TrainForward(data=real, model=LINEAR, earlier=(real,)).parents()
    with pytest.raises(TrajectoryError, match="was recorded with role=sim; a forward model learns the real robot"):
        TrainForward(data=real, model=LINEAR, earlier=(sim,)).run(tmp_path, QUIET)
    other = tmp_path / "other.parquet"
    batch = a_batch(SLOW, "real", pi0=2, others=2)
    write(other, replace(batch, metadata={**batch.metadata, "robot": "crane"}))
    with pytest.raises(TrajectoryError, match=r"other\.parquet: is of another robot than .*: crane"):
        TrainForward(data=real, model=LINEAR, earlier=(str(other),)).run(tmp_path, QUIET)


def test_what_is_for_several_iterations_is_refused_where_there_is_one(tmp_path: Path) -> None:
    for asked in (("grounding=none", "iterations=2"), ("grounding=gat", "iterations=1")):
        said = refused("iterate", "aggregate=true", *asked, folder=tmp_path)
        assert said.startswith("aggregate = true: is for a grounding that learns from real trajectories")
    said = gsl("reproduce", "fig12", "iterate.aggregate=true", folder=tmp_path)
    assert said.code == 2 and "iterate.aggregate = true: is for a grounding that learns" in said.lines[-1]


@pytest.mark.parametrize(("method", "bound"), [("regression", 0.03), ("solve", 0.6)])
def test_the_inverse_model_recovers_what_was_carried_out(sim: str, tmp_path: Path, method: str, bound: float) -> None:
    metrics = TrainInverse(data=sim, model=LINEAR, method=method).run(tmp_path, QUIET)
    assert metrics["method"] == method
    assert metrics["heldout"]["recovered_action_deg"] < bound


@pytest.mark.parametrize(("method", "left"), [("regression", 0.01), ("solve", 0.2)])
def test_the_chain_makes_a_quick_simulator_move_like_the_slow_robot(
    real: str, sim: str, tmp_path: Path, method: str, left: float
) -> None:
    memoryless = ModelConfig(family="linear", ridge=1e-6, history=0)
    TrainForward(data=real, model=memoryless).run(tmp_path, QUIET)
    TrainInverse(data=sim, model=memoryless, method=method, damping=0.05).run(tmp_path, QUIET)
    models = (str(tmp_path / f"{kind}_model.safetensors") for kind in ("forward", "inverse"))
    grounding = LoadedTransformation(read_forward_model(next(models)), read_inverse_model(next(models)))
    worlds = [ToyEnv(SLOW), ToyEnv(QUICK), GroundedEnv(ToyEnv(QUICK), grounding)]
    paths = []
    for world in worlds:
        world.reset(seed=3)
        paths.append(np.array([world.step(0.4 * np.sin(0.3 * tick + np.array([0.0, 1.0])))[0] for tick in range(60)]))
    robot, simulator, grounded = (path[5:, LAYOUT["position"]] for path in paths)
    assert np.abs(grounded - robot).max() < left * np.abs(simulator - robot).max()


def test_models_of_the_joints_of_interest_see_nothing_of_the_others(real: str, sim: str, tmp_path: Path) -> None:
    partial = replace(LINEAR, variables=("LKneePitch",), rested=True)
    metrics = TrainForward(data=real, model=partial).run(tmp_path, QUIET)
    TrainInverse(data=sim, model=partial, method="solve").run(tmp_path, QUIET)
    f = read_forward_model(str(tmp_path / "forward_model.safetensors"))
    f_inverse = read_inverse_model(str(tmp_path / "inverse_model.safetensors"))
    assert f.joints == f_inverse.joints == ("LKneePitch",)
    assert f.history.rested and f_inverse.history.rested
    assert metrics["heldout"]["off_pi0"]["one_step_by_joint_deg"].keys() == {"LKneePitch"}
    assert read(tmp_path / HELDOUT).joints == LAYOUT.joints  # a check replays the whole robot


@pytest.mark.parametrize(
    ("variables", "line"),
    [
        (("LKneePich",), "model.variables = LKneePich: the robot has no joint of this name; did you mean LKneePitch?"),
        ((1,), "model.variables = 1: the robot has no joint of this name"),
    ],
)
def test_joints_of_interest_are_the_robots(real: str, tmp_path: Path, variables: tuple, line: str) -> None:
    with pytest.raises(ConfigError) as caught:
        TrainForward(data=real, model=replace(LINEAR, variables=variables)).run(tmp_path, QUIET)
    assert str(caught.value).startswith(line)


@pytest.fixture
def inverse(sim: str, tmp_path: Path) -> str:
    folder = tmp_path / "inverse"
    folder.mkdir()
    TrainInverse(data=sim, model=LINEAR, method="solve").run(folder, QUIET)
    return str(folder / "inverse_model.safetensors")


@pytest.mark.parametrize("likelihood", ["point", "gaussian"])
def test_a_residual_of_which_nothing_is_known_leaves_the_simulator(
    real: str, inverse: str, tmp_path: Path, likelihood: Any
) -> None:
    rows = transitions(a_batch(SLOW, "real").episodes, LINEAR.of_joints, 1, carried_out=True)
    windows = rows.windows
    simulator = read_inverse_model(inverse).simulator
    for name, ridge, near in (("shrunk", 1e6, True), ("fitted", 1e-6, False)):
        (tmp_path / name).mkdir()
        model = replace(LINEAR, ridge=ridge, likelihood=likelihood)
        TrainForward(real, model, residual_to=inverse).run(tmp_path / name, QUIET)
        residual = read_forward_model(str(tmp_path / name / "forward_model.safetensors"))
        assert residual.base is not None and residual.base.joints == simulator.joints
        apart = np.abs(residual.effects(windows) - simulator.effects(windows)).max()
        assert (apart < 1e-2) == near
        np.testing.assert_allclose(residual.effect(windows[0]), residual.effects(windows)[0], atol=1e-6)
    assert residual.effects(windows) == pytest.approx(rows.change, abs=1e-3)


def test_what_cannot_be_corrected_is_refused(real: str, sim: str, inverse: str, tmp_path: Path) -> None:
    TrainInverse(data=sim, model=LINEAR).run(tmp_path, QUIET)
    regression = str(tmp_path / "inverse_model.safetensors")
    for model, reference, line in (
        (LINEAR, regression, "residual_to: holds no model of the simulator; train it with method=solve"),
        (replace(LINEAR, history=5), inverse, "model: the model that is corrected looks 3 ticks back and 1 ahead"),
        (replace(LINEAR, encoding="sincos"), inverse, "model.encoding = sincos: angles that are corrected are plain"),
    ):
        with pytest.raises(ConfigError) as caught:
            TrainForward(real, model, residual_to=reference).run(tmp_path, QUIET)
        assert str(caught.value).startswith(line)
    TrainForward(data=real, model=LINEAR).run(tmp_path, QUIET)
    grounding = ActionTransformation(str(tmp_path / "forward_model.safetensors"), inverse, residual=True)
    with pytest.raises(ConfigError, match="corrects no simulator"):
        grounding.load(read_forward_model, read_inverse_model)


def test_unlabelled_episodes_are_those_of_pi0(tmp_path: Path) -> None:
    batch = a_batch(SLOW, "real")
    del batch.metadata["episodes"]  # type: ignore[attr-defined]
    write(tmp_path / "real.parquet", batch)
    assert set(labels(read(tmp_path / "real.parquet"))) == {"pi0"}
    metrics = TrainForward(data=str(tmp_path / "real.parquet"), model=LINEAR).run(tmp_path, QUIET)
    assert metrics["heldout"].keys() == {"pi0"}


def test_two_trajectories_are_too_few(tmp_path: Path) -> None:
    write(tmp_path / "real.parquet", a_batch(SLOW, "real", pi0=2, others=0))
    with pytest.raises(TrajectoryError, match="holds 2 episodes"):
        TrainForward(data=str(tmp_path / "real.parquet"), model=LINEAR).run(tmp_path, QUIET)


def test_a_sensor_that_was_not_recorded_is_named(real: str, tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match=r"foot_force\.left.*leave the sensor out"):
        TrainForward(data=real, model=ModelConfig(family="linear", sensors=("foot_force",))).run(tmp_path, QUIET)


def test_logs_of_the_other_world_are_refused(real: str, sim: str, tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match="role=sim"):
        TrainForward(data=sim, model=LINEAR).run(tmp_path, QUIET)
    with pytest.raises(TrajectoryError, match="role=real"):
        TrainInverse(data=real, model=LINEAR).run(tmp_path, QUIET)


def test_a_gaussian_ensemble_is_trained_by_likelihood_and_knows_what_it_has_seen(real: str, tmp_path: Path) -> None:
    model = ModelConfig(family="linear", ridge=1e-6, likelihood="gaussian", members=3)
    measured = TrainForward(data=real, model=model).run(tmp_path, QUIET)["heldout"]["off_pi0"]
    assert measured["nll"] < -5.0
    ensemble = read_forward_model(str(tmp_path / "forward_model.safetensors"))
    assert isinstance(ensemble, Ensemble)
    assert len(ensemble.members) == 3
    assert ensemble.judge(np.full(ensemble.history.size(2), 50.0))[1].min() > 3.0


def test_auto_takes_the_history_that_predicts_best_and_says_what_it_tried(real: str, sim: str, tmp_path: Path) -> None:
    model = ModelConfig(family="linear", ridge=1e-6, history="auto")
    for stage, folder in ((TrainForward(real, model), tmp_path / "f"), (TrainInverse(sim, model), tmp_path / "g")):
        folder.mkdir()
        metrics = stage.run(folder, QUIET)
        scores = metrics["scores"]
        assert scores.keys() == {f"linear_{ticks}" for ticks in HISTORIES}
        assert scores[f"linear_{metrics['history']}"] == min(scores.values())
    assert read_forward_model(str(tmp_path / "f/forward_model.safetensors")).history.ticks in HISTORIES


def test_a_joint_at_rest_does_not_become_a_regressor() -> None:
    """What it does by microradians goes along with the others' motion in one world and not in another."""
    rng = np.random.default_rng(0)
    moving = 0.1 * rng.normal(size=(400, 1))
    still = 1e-5 * moving + 1e-6 * rng.normal(size=(400, 1))
    weight = fit_linear(np.hstack([moving, still]), moving, ridge=1e-2).layers[0][0][0]
    assert weight[0] == pytest.approx(1.0, abs=0.02)
    assert abs(weight[1]) < 1.0


def test_noise_on_real_actions_is_part_of_what_was_done(tmp_path: Path) -> None:
    write(tmp_path / "real.parquet", a_batch(SLOW, "real", noise=0.05))
    metrics = TrainForward(data=str(tmp_path / "real.parquet"), model=LINEAR).run(tmp_path, QUIET)
    assert metrics["heldout"]["off_pi0"]["r2"] > 0.9999


def test_a_residual_is_trained_whatever_the_recipe_says_of_models(tmp_path: Path) -> None:
    few = ("budget.real_episodes=3", "budget.sim_episodes=3", "task.duration=1.6", "workers=1")
    train(read_iterate("recipe=paper", "preset=toy", "grounding=gat_residual", *few), tmp_path)
    model = read_forward_model(str(tmp_path / "train_forward/forward_model.safetensors"))
    assert model.base is not None and model.encoding == "plain"


def test_a_residual_that_cannot_be_is_refused_before_the_robot_is_asked(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="is linear and has no mixture; say predicts=gaussian"):
        ActionTransformation("f", "i", predicts="mixture", residual=True)
    cart = ("experiment=gymnasium", "sim.env_id=CartPole-v1", "real.env_id=CartPole-v1", "grounding=gat_residual")
    said = refused("iterate", *cart, folder=tmp_path)
    assert said == "grounding.residual: is for robots; f of an environment's states corrects nothing"
