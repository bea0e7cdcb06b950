"""A learned servo used: train-servo, its world, iterate and compare with it, and what is refused; on toy sizes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
import yaml
from browser import check_seen
from commands import Said, done, refused

from gsl.core.checkpoint import read_checkpoint
from gsl.effects.effect import names
from gsl.models.servo import ServoModel
from gsl.models.servo_file import FILE, read_servo
from gsl.storage.checkpoints import write_checkpoint
from gsl.storage.trajectories import read
from gsl.training.servo_verdict import problems, remarks
from gsl.worlds.bullet import BulletWorld

pytestmark = pytest.mark.slow

STEP = 0.004  # [s], twice the usual one: half the time where a number need not come out
ON_FOOT = ("preset=toy", "task.duration=1.2", "workers=1")
SHORT = (*ON_FOOT, "optimizer.generations=1", "optimizer.candidates=4")
SOFT = ("real=nao_ideal", "real.effects.servo_gain.kp=0.6", "real.effects.command_latency.delay=0.02")
LINE = ("iterate", *SHORT, *SOFT, "name=air", "accept=true", "grounding=servo")
FIRST = "runs/air/iteration_01"
OTHERS = sorted({*names()} - {"command_latency", "servo_gain", "coulomb_friction"})  # left out of a diagnosis
TRAIN = ("train-servo", f"real={FIRST}/collect_excitation", "workers=1", f"sim.step={STEP}")


@pytest.fixture(scope="module")
def air(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Said]:
    """One iteration with a learned servo, against a robot that is softer and later."""
    folder = tmp_path_factory.mktemp("air")
    return folder, done(*LINE, folder=folder)


def loaded(path: Path) -> Any:
    return json.loads(path.read_text()) if path.suffix == ".json" else yaml.safe_load(path.read_text())


def test_iterate_learns_the_servo_by_itself_and_reports_the_gap(air: tuple[Path, Said]) -> None:
    folder, said = air
    metrics = loaded(folder / "runs/air/iterate/metrics.json")
    servo = loaded(folder / FIRST / "train_servo/metrics.json")
    assert metrics["servo"]["floors_after"] == servo["floors_after"]
    assert servo["floors_after"] < 0.1 * servo["floors_before"]
    assert metrics["excitation"]["episodes"] == 5
    screened = loaded(folder / FIRST / "optimize/metrics.json")["screened"]
    assert screened.keys() == {"generation_01"}
    sentence = f"from {servo['floors_before']:.1f} to {servo['floors_after']:.2f} noise floors"
    assert sentence in said.out and sentence in (folder / "runs/air/iterate/table.md").read_text()
    parents = loaded(folder / FIRST / "optimize/manifest.json")["parents"]
    assert [parent["role"] for parent in parents] == ["grounding.servo"]


def test_what_was_learned_has_a_page_with_the_figures_of_its_results(air: tuple[Path, Said]) -> None:
    place = air[0] / FIRST / "train_servo"
    metrics = loaded(place / "metrics.json")
    gap = f"from {metrics['floors_before']:.1f} to {metrics['floors_after']:.2f} noise floors"
    check_seen(place / "report.html", gap, "time after a step", "speed [rad/s]", "delay [ms]", "motions in the air")


def test_a_motion_and_a_walk_are_drawn(air: tuple[Path, Said]) -> None:
    folder, said = air
    made = {path.name for path in (folder / "runs/air/iterate").iterdir()}
    assert {"joint_trace.png", "walk.png", "learning_curve.png"} < made
    assert "(joint_trace.png, learning_curve.png, walk.png)" in said.out


def test_nothing_is_done_twice(air: tuple[Path, Said]) -> None:
    folder, _ = air
    assert "(unchanged)" in done(*LINE, folder=folder).out.splitlines()[-1]


def test_the_numbers_are_those_of_the_robot(air: tuple[Path, Said]) -> None:
    folder, _ = air
    model = read_servo(str(folder / FIRST / "train_servo"))
    legs = model.group == model.groups.index("legs")
    np.testing.assert_allclose(np.exp(model.numbers["kp"][legs]).mean(), 0.6, rtol=0.1)
    np.testing.assert_allclose(model.numbers["delay"][legs].mean(), 0.02, atol=0.004)


def test_the_grounding_hands_over_stiffness_as_no_action_can(air: tuple[Path, Said]) -> None:
    folder, _ = air
    share = loaded(folder / "runs/air/iterate/metrics.json")["compliance"]["legs"]["share"]["stiffness"]
    assert 0.8 < share < 1.2


def test_its_world_works_in_every_command_as_a_diagnosed_one_does(air: tuple[Path, Said]) -> None:
    folder, _ = air
    place = f"{FIRST}/train_servo"
    learned = loaded(folder / place / "world/learned.yaml")
    assert learned["servo"] == FILE  # as seen from its own folder
    of_folder = ("--config-dir", place, "world=learned")
    of_run = ("world=learned", f"world.servo={place}")
    logs = []
    for name, choice in {"file": of_folder, "run": of_run}.items():
        done("collect", *choice, "role=sim", *ON_FOOT, "episodes=1", "neighbours=0", f"name={name}", folder=folder)
        logs.append(read(folder / f"runs/{name}/collect_sim/trajectories.parquet").episodes[0].position)
        manifest = loaded(folder / f"runs/{name}/collect_sim/manifest.json")
        assert "world.servo" in [parent["role"] for parent in manifest["parents"]]
    np.testing.assert_array_equal(*logs)


def test_a_servo_stands_on_what_is_switched_on(air: tuple[Path, Said]) -> None:
    folder, _ = air
    world = BulletWorld("nao", {"servo_gain": {"kp": 0.5}}, servo=str(folder / FIRST / "train_servo"))
    bare = BulletWorld("nao", {"servo_gain": {"kp": 0.5}})
    model = read_servo(str(folder / FIRST / "train_servo"))
    np.testing.assert_allclose(world.plant.servo.kp, bare.plant.servo.kp * np.exp(model.numbers["kp"]))
    assert world.plant.law is not None and bare.plant.law is None


def test_compare_and_effects_servo_share_the_flight(air: tuple[Path, Said]) -> None:
    folder, _ = air
    line = ("compare", "preset=toy", "trials=1", "name=both", "iterate.task.duration=1.2", "iterate.workers=1")
    worlds = ("~worlds.nao_weak", f"worlds.nao_worn.step={STEP}", f"iterate.sim.step={STEP}")
    methods = [f"~methods.{name}" for name in ("none", "ane_01", "ane_02", "gat", "gat_005", "effects_gat")]
    few = (f"iterate.diagnosis.without={OTHERS}", "iterate.optimizer.generations=1")
    few += ("iterate.optimizer.candidates=4", "iterate.budget.rollouts=1", "iterate.budget.confirmation=2")
    said = done(*line, *worlds, *methods, "+grounding@methods.effects_servo=effects_servo", *few, folder=folder)
    document = loaded(folder / "runs/both/compare/metrics.json")
    assert {summary["method"] for summary in document["summaries"]} == {"effects", "effects_servo"}
    below = next((folder / "runs/both").rglob("diagnosis")) / "trial_01"
    assert {path.name for path in below.iterdir()} == {"collect_excitation", "diagnose", "train_servo_on_effects"}
    on_effects = loaded(below / "train_servo_on_effects/config.yaml")["sim"]["effects"]
    assert on_effects == loaded(below / "diagnose/world/diagnosed.yaml")["effects"]
    assert "servo" in said.out
    for trial in loaded(folder / "runs/both/compare/trials.json"):
        measured = below.parents[1] / trial["method"] / "trial_01/evaluate/metrics.json"
        assert trial["real_episodes"] == loaded(measured)["real_episodes"] + 5


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        (("real=nowhere",), "nowhere"),
        ((f"sim.servo={FIRST}/train_servo",), "learned servo already"),
        (("real=ground",), "needs the robot in the air"),
        (("sim=so101",), "another robot?"),
        (("tolerance=-1",), "tolerance"),
    ],
)
def test_bad_input_gets_one_line(air: tuple[Path, Said], changes: tuple[str, ...], problem: str) -> None:
    folder, _ = air
    if not (folder / "runs/ground").exists():
        done("collect", "role=real", *ON_FOOT, "episodes=1", "neighbours=0", "name=ground", folder=folder)
    changed = {change.partition("=")[0] for change in changes}
    line = [word for word in TRAIN if word.partition("=")[0] not in changed]
    assert problem in refused(*line, *changes, "name=refused", folder=folder)


def test_walks_bring_walks_nearer_and_a_further_member_is_as_near(air: tuple[Path, Said]) -> None:
    folder, _ = air
    world = [word.replace("real", "world", 1) for word in SOFT]
    few = ("episodes=2", "neighbours=0", "name=walked")
    done("collect", "role=real", *world, *ON_FOOT, *few, folder=folder)
    done(*TRAIN, "walks=walked/collect_real", "members=2", "name=walked", folder=folder)
    metrics = loaded(folder / "runs/walked/train_servo/metrics.json")
    assert metrics["walks"]["floors_after"] < 0.5 * metrics["walks"]["floors_before"]
    assert metrics["members"][0] == metrics["floors_after"] and len(metrics["members"]) == 2
    assert max(metrics["members"]) < 0.2 * metrics["floors_before"]
    two = str(folder / "runs/walked/train_servo")
    assert read_servo(two, 1).joints == read_servo(two).joints
    said = refused(*TRAIN, f"walks={FIRST}/collect_excitation", "name=refused", folder=folder)
    assert "the robot is in the air here" in said


def test_a_log_with_a_hole_is_refused_by_its_row(air: tuple[Path, Said], tmp_path: Path) -> None:
    folder, _ = air
    whole = pq.read_table(folder / FIRST / "collect_excitation/trajectories.parquet")
    pq.write_table(whole.filter(pc.not_equal(whole["step"], 30)), tmp_path / "holes.parquet")
    line = [word for word in TRAIN if not word.startswith("real=")]
    said = refused(*line, f"real={tmp_path / 'holes.parquet'}", "name=refused", folder=folder)
    assert "holes.parquet" in said and len(said.strip().splitlines()) == 1


def test_a_servo_of_another_robot_or_version_is_refused(air: tuple[Path, Said], tmp_path: Path) -> None:
    folder, _ = air
    arrays, about = read_checkpoint(folder / FIRST / "train_servo" / FILE, kind=ServoModel.kind)
    other = tmp_path / "other" / FILE
    other.parent.mkdir()
    write_checkpoint(other, arrays, {**about, "robot": "so101"})
    line = ("collect", "role=sim", "world=learned", *ON_FOOT, "name=refused")
    assert "was learned for the so101" in refused(*line, f"world.servo={other}", folder=folder)
    write_checkpoint(other, {**arrays, "lag": arrays["lag"][:, :3]}, about)
    assert "train it again" in refused(*line, f"world.servo={other}", folder=folder)
    other.write_bytes(other.read_bytes()[:100])
    assert "truncated or damaged" in refused(*line, f"world.servo={other}", folder=folder)
    assert "no learned servo" in refused(*line, f"world.servo={tmp_path}", folder=folder)


def test_a_servo_far_from_its_log_or_worse_than_none_is_a_problem(air: tuple[Path, Said]) -> None:
    folder, _ = air
    metrics = loaded(folder / FIRST / "train_servo/metrics.json")
    assert problems(metrics) == []
    assert "more than 3" in problems({**metrics, "floors_after": 4.2})[0]
    assert "sim.step=0.002" not in problems({**metrics, "floors_after": 4.2})[0]
    assert "try sim.step=0.002" in problems({**metrics, "floors_after": 4.2, "step": 0.004})[0]
    assert "1.80 noise floors, 1.60 without" in problems({**metrics, "floors_before": 1.6, "floors_after": 1.8})[0]
    assert problems({**metrics, "floors_before": 1.0, "floors_after": 1.2}) == []  # a simulator that is right
    assert any("not within 1" in line for line in remarks({**metrics, "floors_after": 2.0}))
    none = {
        **metrics,
        "floors_after": 0.9,
        "learned": False,
        "groups": {"legs": {"floors_after": 0.9, "learned": False}},
    }
    assert remarks(none) == ["legs keep their servo: nothing that was learned brought held-out motions nearer"]
    assert problems(none) == []
    assert problems({**none, "floors_after": 2.5}) == [
        "nothing was learned: held out, the gap stays at 2.5 noise floors"
    ]
    assert problems({**none, "floors_after": 1.2}) == []
    assert "of other motions it says nothing" in problems({**metrics, "whole_motions": False})[0]
    assert "servos remember 25.4 ms of commands at the log's rate" in remarks({**metrics, "period": 0.0002})[0]
    assert remarks({**metrics, "period": 0.005}) == remarks(metrics)
    far = {"legs": {"floors_before": 9.0, "floors_after": 3.4, "learned": True}}
    assert "legs are 3.4 noise floors from the log, more than 3" in remarks({**metrics, "groups": far})[-1]
