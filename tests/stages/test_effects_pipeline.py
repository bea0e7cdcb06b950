"""A diagnosis used: iterate and compare with diagnosed effects, its world file, its next experiment, on toy sizes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from chains import read_iterate, search
from commands import Said, done

from gsl.core.console import Silent
from gsl.core.setting import settings_of
from gsl.core.validation import make
from gsl.effects.effect import names
from gsl.errors import ConfigError
from gsl.policies.excitation import Excitation
from gsl.stages.cross_validate import CrossValidate
from gsl.stages.diagnose import Diagnose
from gsl.stages.diagnosis_plan import DiagnosisPlan
from gsl.stages.identify import Identify
from gsl.storage.policies import read_policies
from gsl.storage.trajectories import read
from gsl.worlds.bullet import BulletWorld

pytestmark = pytest.mark.slow

LATE = ("real=nao_ideal", "real.effects.command_latency.delay=0.02")
SHORT = ("preset=toy", "task.duration=1.2", "workers=1", "optimizer.generations=1", "optimizer.candidates=4")
LINE = ("iterate", *SHORT, *LATE, "name=air", "accept=true")
FIRST = "runs/air/iteration_01"


@pytest.fixture(scope="module")
def air(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Said]:
    """One iteration with diagnosed effects, against a robot whose commands arrive late."""
    folder = tmp_path_factory.mktemp("air")
    return folder, done(*LINE, "grounding=effects", folder=folder)


def loaded(path: Path) -> Any:
    return json.loads(path.read_text()) if path.suffix == ".json" else yaml.safe_load(path.read_text())


def test_iterate_names_what_the_simulator_lacks_and_what_it_cost(air: tuple[Path, Said]) -> None:
    folder, said = air
    metrics = loaded(folder / "runs/air/iterate/metrics.json")
    assert (metrics["diagnosis"]["verdict"], metrics["diagnosis"]["causes"]) == ("causes", ["command_latency"])
    assert metrics["excitation"] == {"episodes": 5, "real_seconds": pytest.approx(7.5)}
    measured = loaded(folder / FIRST / "evaluate/metrics.json")["real_episodes"]
    assert (metrics["learned_from"], metrics["real_episodes"]) == (0, measured + 5)
    table = (folder / "runs/air/iterate/table.md").read_text()
    for sentence in (
        "Diagnosis: causes. ",
        "Switched on in the simulator: command_latency.",
        f"{measured} + 5 in the air",
    ):
        assert sentence in said.out and sentence in table
    spent = f"5 motions in the air (8 s) to diagnose, 0 episodes to learn from, {measured} to measure"
    assert f"real data: {spent}, {measured + 5} in all\n" in said.out


def test_every_link_is_there_and_nothing_is_done_twice(air: tuple[Path, Said]) -> None:
    folder, _ = air
    links = {"collect_excitation", "diagnose", "optimize", "evaluate"}
    assert {path.name for path in (folder / FIRST).iterdir()} >= links
    assert [parent["role"] for parent in loaded(folder / FIRST / "optimize/manifest.json")["parents"]] == [
        "grounding.diagnosis"
    ]
    assert "(unchanged)" in done(*LINE, "grounding=effects", folder=folder).out.splitlines()[-1]


def test_a_transformation_inside_learns_from_the_diagnosed_simulator(air: tuple[Path, Said]) -> None:
    folder, _ = air
    said = done(*LINE, "grounding=effects_gat", "recipe.forward=linear", "out=runs/air/with_gat", folder=folder)
    assert any(line.startswith(f"{FIRST}/diagnose: ") and "(unchanged)" in line for line in said.lines)
    assert "command_latency" in loaded(folder / FIRST / "collect_sim/config.yaml")["world"]["effects"]
    models = [loaded(folder / FIRST / f"{stage}/config.yaml")["model"] for stage in ("train_inverse", "train_forward")]
    assert [model["horizon"] for model in models] == [3, 3]  # an action is a tick late there
    assert loaded(folder / FIRST / "optimize/metrics.json")["effects"] == ["command_latency"]
    assert 0.0 < loaded(folder / FIRST / "optimize/metrics.json")["alpha"] <= 1.0
    assert (folder / "runs/air/with_gat/joint_trace.png").is_file()


def test_the_world_file_and_the_grounding_are_one_simulator_and_the_terminal_says_how(air: tuple[Path, Said]) -> None:
    folder, _ = air
    output = done("show", "air/iteration_01/diagnose", folder=folder).out
    chosen = ("--config-dir", f"{FIRST}/diagnose", "world=diagnosed")
    assert f"gsl optimize {' '.join(chosen)} grounding=none" in output
    line = ("optimize", *SHORT)
    done(*line, "name=file", *chosen, "grounding=none", folder=folder)
    done(*line, "name=grounded", "grounding=effects", f"grounding.diagnosis={FIRST}/diagnose", folder=folder)
    first, second = (read_policies(folder / f"runs/{name}/optimize/policies.json") for name in ("file", "grounded"))
    assert first.records == second.records


def test_the_next_experiment_can_be_played_and_has_a_repeat(air: tuple[Path, Said]) -> None:
    folder, _ = air
    report = loaded(folder / FIRST / "diagnose/report.json")["next_experiment"]
    assert report["file"] == "next_experiment.json" and report["separates"] and report["why"]
    file = f"{FIRST}/diagnose/next_experiment.json"
    done("collect", "task=excite", "workers=1", "name=next", f"policy.file={file}", folder=folder)
    batch = read(folder / "runs/next/collect_real/trajectories.parquet")
    labels = [episode["policy"] for episode in batch.metadata["episodes"]]
    assert labels == [f"{report['excitation']}_{variant}" for variant in ("a", "b", "a")]
    assert file in done("show", "air/iteration_01/diagnose", folder=folder).out


def test_identification_fits_the_same_log_without_a_verdict(air: tuple[Path, Said]) -> None:
    folder, _ = air
    said = done(*LINE, "grounding=identified", "out=runs/air/identified", folder=folder)
    assert any(line.startswith(f"{FIRST}/collect_excitation: ") and "(unchanged)" in line for line in said.lines)
    document = loaded(folder / FIRST / "identify/report.json")
    assert 0.01 < document["effects"]["command_latency"][0]["delay"] < 0.025
    assert document["shrinkage"]["after"] < 0.6 * document["shrinkage"]["before"]
    assert "Diagnosis: identified. 18 parameters of 17 effects were fitted at once: held out, " in said.out


def test_what_a_plan_leaves_out_is_no_candidate(tmp_path: Path) -> None:
    played = Excitation("nao", motions=("steps_large",), duration=1.5)
    left_out = tuple(sorted({*names()} - {"coulomb_friction"}))
    plan = DiagnosisPlan(played, duels=0, nulls=0, evaluations=16, without=left_out)
    world = BulletWorld("nao", {})  # without a gap nothing is searched
    for method in ("diagnose", "identify"):
        made = plan.carry_out(world, world, method, tmp_path, workers=1, seed=1, console=Silent())
        assert (made.manifest.kind, made.config["without"]) == (method, [*left_out])


@pytest.mark.parametrize("stage", [Diagnose, Identify, CrossValidate, DiagnosisPlan])
def test_no_stage_leaves_out_an_effect_that_there_is_none_of(stage: type) -> None:
    needed = {"real": "log", "sim": BulletWorld("nao", {}), "excitation": Excitation("nao"), "by": "gain"}
    settings = {name: value for name, value in needed.items() if name in settings_of(stage)}
    where = r"^plan\.without = .*: latency: no effect of this name; did you mean command_latency\?$"
    with pytest.raises(ConfigError, match=where):
        make(stage, {**settings, "without": ["latency"]}, where="plan")


def test_an_identification_that_finds_nothing_better_leaves_the_simulator_as_it_is(air: tuple[Path, Said]) -> None:
    folder, _ = air
    line = ("identify", f"real={FIRST}/collect_excitation", "sim=nao_ideal", "evaluations=16", "name=short")
    done(*line, folder=folder)
    document = loaded(folder / "runs/short/identify/report.json")
    assert document["shrinkage"]["after"] == pytest.approx(document["shrinkage"]["before"], rel=1e-6)


@pytest.mark.parametrize(
    ("more", "decides"), [(("sgat", "grounding.predicts=mixture"), "alpha"), (("randomised",), "width")]
)
def test_every_other_grounding_goes_through_a_search(more: tuple[str, ...], decides: str, tmp_path: Path) -> None:
    name, *settings = more
    words = (*SHORT, *LATE, "accept=true", f"grounding={name}", *settings, "forward_model.epochs=5")
    assert decides in search(read_iterate(*words), tmp_path).metrics
    if settings:
        trained = loaded(tmp_path / "train_forward/config.yaml")["model"]
        assert (trained["likelihood"], trained["members"]) == ("mixture", 1)
