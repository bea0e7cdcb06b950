"""gsl from Python: the same names, checks and artifacts as on the command line."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from commands import done

import gsl
from gsl.errors import GslError
from gsl.storage.trajectories import read

pytestmark = pytest.mark.slow

FEW = {"world": "nao_ideal", "preset": "toy", "workers": 1, "episodes": 1, "neighbours": 1}


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_package_loads_nothing_before_it_is_used() -> None:
    code = "import sys, gsl; assert not {'numpy', 'hydra', 'gymnasium', 'torch'} & set(sys.modules); gsl.make_world"
    subprocess.run([sys.executable, "-c", code], check=True)
    assert set(gsl.__all__) <= set(dir(__import__("gsl.api", fromlist=["api"])))
    with pytest.raises(AttributeError, match="module 'gsl' has no attribute 'make_word'"):
        _ = gsl.make_word


def test_a_world_has_the_settings_that_are_given() -> None:
    world = gsl.make_world("nao_worn", step=0.001, effects={"ground_friction": {"friction": 0.6}})
    assert world.step == 0.001  # type: ignore[attr-defined]
    effects = world.effects  # type: ignore[attr-defined]
    assert effects["ground_friction"] == {"friction": 0.6}
    assert "torque_limit" in effects  # what makes it worn is still there


def test_an_effect_takes_the_place_of_the_files() -> None:
    before = gsl.make_world("nao_worn").effects  # type: ignore[attr-defined]
    assert isinstance(before["coulomb_friction"], list)
    world = gsl.make_world("nao_worn", effects={"coulomb_friction": {"torque": 0.3}, "torque_limit": {"factor": 0.5}})
    after = world.effects  # type: ignore[attr-defined]
    assert after == before | {"coulomb_friction": {"torque": 0.3}, "torque_limit": {"factor": 0.5}}


@pytest.mark.parametrize("name", ["2024", "1e5", "null", "größe"])
def test_texts_stay_texts(name: str, elsewhere: Path) -> None:
    made = gsl.run("collect", name=name, **FEW | {"neighbours": 0}, task={"duration": 0.1})
    assert made.folder == Path("runs") / name / "collect_real"


def test_rollouts_are_trajectories_that_can_be_written(elsewhere: Path) -> None:
    world, task = gsl.make_world("nao_ideal"), gsl.make_task("walk", duration=0.2)
    batch = gsl.roll_out(world, task, episodes=2, seed=4)
    assert [episode.position.shape for episode in batch.episodes] == [(11, 15)] * 2
    again = gsl.roll_out(world, task, episodes=2, seed=4, workers=2)
    for episode, other in zip(batch.episodes, again.episodes, strict=True):
        np.testing.assert_array_equal(episode.position, other.position)
    gsl.write_trajectories("log.parquet", batch)
    back = gsl.read_trajectories("log.parquet")
    np.testing.assert_array_equal(back.episodes[1].position, batch.episodes[1].position)


def test_a_stage_is_the_same_from_python_and_from_the_command_line(elsewhere: Path) -> None:
    made = gsl.run("collect", name="here", **FEW, task={"duration": 0.2})
    words = [f"{key}={value}" for key, value in FEW.items()]
    done("collect", *words, "name=there", "task.duration=0.2", folder=elsewhere)
    here, there = (f"runs/{name}/collect_real/trajectories.parquet" for name in ("here", "there"))
    assert Path(here).read_bytes() == Path(there).read_bytes()
    assert made.metrics["episodes"] == 2
    assert "<th>episodes</th>" in made._repr_html_()
    again = gsl.run("collect", name="here", **FEW, **{"task.duration": 0.2})
    assert again.artifact.unchanged
    assert again.metrics == made.metrics
    gsl.run("collect", name="here", **FEW, task={"duration": 0.1}, force=True)
    with pytest.raises(GslError, match="here/collect_real: was made anew since this result; run the stage again"):
        _ = made.metrics


def test_a_component_goes_as_it_is(elsewhere: Path) -> None:
    world = gsl.make_world("nao_ideal", effects={"torque_limit": {"factor": 0.5}})
    made = gsl.run("collect", name="mine", **FEW | {"world": world}, task={"duration": 0.1})
    assert made.page == made.folder / "report.html"
    assert made.artifact.config["world"]["effects"] == {"torque_limit": {"factor": 0.5}}


def test_what_refers_to_a_components_settings_sees_them(elsewhere: Path) -> None:
    world, short = gsl.make_world("xl330_pendulum"), {"policy.motions": ["steps_large"], "policy.repeats": 1}
    made = gsl.run("collect", world=world, task="excite", name="pendulum", workers=1, **short)
    assert made.artifact.config["policy"]["robot"] == world.robot  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: gsl.make_world("nao_wron"), "no world called nao_wron; did you mean nao_worn"),
        (lambda: gsl.make_world("nao_worn", stp=1), "world.stp: no such setting; did you mean world.step"),
        (
            lambda: gsl.make_world("nao_worn", effects={"backlsh": {}}),
            "effects.backlsh: no effect of this name; did you mean",
        ),
        (lambda: gsl.make_world("nao_worn", effects={"torque_limit": {}}), "effects.torque_limit.factor: has no value"),
        (lambda: gsl.make_world("nao_worn", effects=3), "world.effects = 3: is a mapping of effects by name"),
        (lambda: gsl.run(3), "command = 3: there is none of this name"),  # type: ignore[arg-type]
        (lambda: gsl.run("import", mapping="no.yaml"), "mapping = no.yaml: there is no such file"),
        (lambda: gsl.run("collect", world=None), "world = null: takes the name of a file"),
        (lambda: gsl.run("collect", name={1}), "settings = set: are numbers, texts"),
        (lambda: gsl.run("collect", world=gsl.make_world("nao_ideal"), **{"world.step": 0.001}), "is below world"),
        (lambda: gsl.roll_out("nao_ideal"), "world = nao_ideal: is no world; gsl.make_world makes one"),  # type: ignore
        (lambda: gsl.roll_out(gsl.make_world("nao_ideal"), workers=0), "workers = 0: must not be 0"),
        (lambda: gsl.roll_out(gsl.make_world("nao_ideal"), role="foo"), "role = foo"),
        (lambda: gsl.roll_out(gsl.make_world("nao_ideal"), episodes=1.5), "episodes = 1.5"),  # type: ignore[arg-type]
        (lambda: gsl.roll_out(gsl.make_world("nao_ideal"), parameters=["a"] * 15), "parameters = "),  # type: ignore
        (lambda: gsl.diagnose("air", "nao_ideal", name="../evil"), "name = ../evil: must be a name in runs/"),
        (lambda: gsl.run("colect"), "command = colect: there is none of this name; did you mean collect?"),
        (lambda: gsl.run("collect", sim=gsl.make_world("nao_ideal")), "sim: gsl collect has no such setting"),
        (
            lambda: gsl.roll_out(gsl.make_world("nao_ideal"), parameters=[1.0]),
            "parameters = shape (1,): are 15 numbers",
        ),
        (lambda: gsl.read_trajectories("nowhere"), "nowhere: there is no such path and no such run"),
    ],
)
def test_mistakes_are_said_in_one_line(call: Callable[[], object], said: str, elsewhere: Path) -> None:
    with pytest.raises(GslError) as caught:
        call()
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_worlds_have_gymnasium_ids() -> None:
    env = gymnasium.make("gsl.gym:gsl/nao_worn-v0", effects={"ground_friction": {"friction": 0.6}})
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    env.step(env.action_space.sample())
    env.close()


def test_a_file_of_python_and_one_of_the_command_line_are_alike(elsewhere: Path) -> None:
    batch = gsl.roll_out(gsl.make_world("nao_ideal"), gsl.make_task("walk", duration=0.2))
    gsl.write_trajectories(Path("log.parquet"), batch)
    assert read(Path("log.parquet")).metadata["source"] == "gsl.roll_out"
