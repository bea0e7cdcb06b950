"""Runs are chosen, set side by side and cleaned up; nothing outside of the runs folder goes."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from commands import done, refused

from gsl.storage.artifact import build
from gsl.tasks.walk import Walk


@dataclass
class Measuring:
    """A stage that reports what it is made with."""

    kind: str
    metrics: Mapping[str, Any]
    above: Mapping[str, Path]
    task: Any = None

    def parents(self) -> Mapping[str, Path]:
        return self.above

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        (folder / "note").write_text(json.dumps(self.metrics))
        return self.metrics


def make(place: str, kind: str, metrics: Mapping[str, Any], *, above: str = "", force: bool = False) -> None:
    parents = {"policies": Path("runs") / above} if above else {}
    config = {
        "policies": f"runs/{above}",
        "world": {"robot": "nao", "effects": {"backlash": {"width": 0.1}}},
        **metrics,
    }
    command = f"gsl {kind} world=worn"
    stage = Measuring(kind, metrics, parents)
    build(stage, config=config, out=Path("runs") / place, command=command, force=force, console=None)  # type: ignore[arg-type]


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for number, value in enumerate((0.3, 0.1, 0.2)):
        make(f"walk{number}/optimize", "optimize", {"best": value, "of": {"falls": number}})
    make("walk0/evaluate", "evaluate", {"best": 0.25}, above="walk0/optimize")
    return tmp_path


def listed(*words: str, folder: Path) -> list[str]:
    artifacts = json.loads(done("runs", *words, "--json", folder=folder).out)["artifacts"]
    return [artifact["folder"].removeprefix("runs/") for artifact in artifacts]


def test_runs_are_sorted_by_any_metric_and_the_first_or_newest_are_kept(home: Path) -> None:
    assert listed("sort=best", folder=home) == ["walk1/optimize", "walk2/optimize", "walk0/evaluate", "walk0/optimize"]
    assert listed("sort=-of.falls", folder=home) == ["walk2/optimize", "walk1/optimize", "walk0/optimize"]
    assert listed("sort=-best", "limit=2", folder=home) == ["walk0/optimize", "walk0/evaluate"]
    assert listed("sort=best", "limit=1", folder=home) == ["walk1/optimize"]
    assert listed("sort=-made", "limit=1", folder=home) == listed("limit=1", folder=home) == listed(folder=home)[-1:]


@pytest.mark.parametrize(
    ("word", "left"),
    [
        ("kind=evaluate", ["walk0/evaluate"]),
        ("name=walk0", ["walk0/evaluate", "walk0/optimize"]),
        ("name=*1/opt*", ["walk1/optimize"]),
        ("metric=best>0.2", ["walk0/evaluate", "walk0/optimize"]),
        ("metric=of.falls<=0", ["walk0/optimize"]),
        ("newer=1d", ["walk0/evaluate", "walk0/optimize", "walk1/optimize", "walk2/optimize"]),
        ("older=1d", []),
        ("world=backlash", ["walk0/evaluate", "walk0/optimize", "walk1/optimize", "walk2/optimize"]),
        ("world=worn", ["walk0/evaluate", "walk0/optimize", "walk1/optimize", "walk2/optimize"]),
    ],
)
def test_runs_are_chosen_by_one_word(word: str, left: list[str], home: Path) -> None:
    assert listed(word, "sort=name", folder=home) == left


def test_a_run_is_found_by_the_world_that_it_had_by_default(home: Path) -> None:
    world = {"_target_": "gsl.worlds.bullet.BulletWorld", "robot": "nao", "effects": {"torque_limit": {"factor": 0.75}}}
    stage = Measuring("evaluate", {"falls": 1}, {})
    build(stage, config={"world": {**world, "step": 0.001}}, out=Path("runs/weak/evaluate"), command="gsl evaluate",
          force=False, console=None)  # type: ignore[arg-type]  # fmt: skip
    assert listed("world=nao_weak", folder=home) == ["weak/evaluate"]
    assert "no artifact below runs/ has it" in refused("runs", "world=nao_ideal", folder=home)
    assert "other artifacts have of.falls" in done("runs", "metric=falls", folder=home).out


@pytest.mark.parametrize(
    ("word", "line"),
    [
        ("sort=falls", "did you mean of.falls? There is best, of.falls"),
        ("sort=speed", "none of these artifacts has this metric; there is best, of.falls"),
        ("kind=fly", "there is evaluate, optimize"), ("newer=soon", "7d"),
        ("metric=best>much", "condition"), ("limit=-1", "at least 0"), ("colour=red", "no such setting"),
        ("best", "name=value"), ("world=mars", "no artifact"),
    ],
)  # fmt: skip
def test_a_wrong_word_of_runs_is_one_line(word: str, line: str, home: Path) -> None:
    assert line in refused("runs", word, folder=home)


def test_diff_shows_what_differs_and_nothing_else(home: Path) -> None:
    report = json.loads(done("diff", "walk0/optimize", "walk1", "--json", folder=home).out)
    assert report["metrics"] == {"best": [0.3, 0.1], "of.falls": [0, 1]}
    assert report["settings"] == report["metrics"]  # the stage reports what it was made with
    assert (report["made_from"], report["software"], report["same"]) == ({}, {}, False)
    assert "-0.2" in done("diff", "walk0/optimize", "walk1", folder=home).out
    assert "the same settings" in done("diff", "walk1", "walk1", folder=home).out
    assert "did you mean walk1" in refused("diff", "walk1", "walc1", folder=home)


def test_diff_knows_defaults_and_what_is_no_setting(home: Path) -> None:
    world = {"_target_": "gsl.worlds.bullet.BulletWorld", "robot": "nao"}
    bare, servo = ({"_target_": f"gsl.grounding.{name}"} for name in ("none.NoGrounding", "servo.LearnedServo"))
    configs = {
        "old": {"world": world, "grounding": bare},
        "new": {"world": {**world, "servo_member": 0, "motors": "velocity"}, "grounding": {**servo, "noise": 0.2}},
    }
    for place, config in configs.items():
        stage = Measuring("evaluate", {}, {})
        build(stage, config=config, out=Path("runs") / place, command="gsl evaluate", force=False, console=None)  # type: ignore[arg-type]
    settings = json.loads(done("diff", "old", "new", "--json", folder=home).out)["settings"]
    assert settings["world.motors"] == ["servo", "velocity"]
    assert "world.servo_member" not in settings
    assert settings["grounding.noise"] == ["not a setting", 0.2]


def test_a_quantity_is_shown_in_one_unit(home: Path) -> None:
    for name, speed in (("slow", 0.2), ("fast", 0.25)):
        metrics = {"value": speed, "interval": [speed, None], "gain": {"share": speed}, "outcome": {"way [m]": speed}}
        stage = Measuring("evaluate", {"returned": metrics}, {}, Walk())
        build(stage, config={}, out=Path("runs") / name, command="gsl evaluate", force=False, console=None)  # type: ignore[arg-type]
    rows = {line.split("  ")[1]: line.split() for line in done("diff", "slow", "fast", folder=home).out.splitlines()
            if line.startswith("  returned.")}  # fmt: skip
    assert rows["returned.value [cm/s]"][-3:] == ["20", "25", "+5"]
    assert rows["returned.interval.0 [cm/s]"][-3:] == rows["returned.value [cm/s]"][-3:]
    assert rows["returned.gain.share"][-3:] == rows["returned.outcome.way [m]"][-3:] == ["0.2", "0.25", "+0.05"]
    metrics = json.loads(done("diff", "slow", "fast", "--json", folder=home).out)["metrics"]
    assert metrics["returned.value"] == [0.2, 0.25]
    assert {"[cm/s]", "20", "25"} <= {*done("runs", "sort=returned.value", folder=home).out.split()}
    for name in ("returned.value", "returned.value [cm/s]"):
        assert listed(f"metric={name}>22", folder=home) == listed(f"sort=-{name}", "limit=1", folder=home) == ["fast"]
    table = done("show", "slow", folder=home).out
    assert "returned.value [cm/s]" in table and "[20, none]" in table


def test_clean_removes_what_it_has_named_when_it_is_asked_to(home: Path) -> None:
    for name in ("walk1/.evaluate.partial", ".multirun/collect-x", "killed/.optimize.tmp-99999999"):
        (home / "runs" / name).mkdir(parents=True)
        (home / "runs" / name / "work").write_bytes(b"0" * 1000)
    before = json.loads(done("clean", "--json", folder=home).out)
    assert [entry["bytes"] for entry in before["entries"]] == [1000] * 3 and not before["removed"]
    assert "3,000 B could go" in done("clean", folder=home).out
    assert "3,000 B removed" in done("clean", "--yes", folder=home).out
    assert sorted(path.name for path in (home / "runs").iterdir()) == ["walk0", "walk1", "walk2"]
    assert [path.name for path in (home / "runs/walk1").iterdir()] == ["optimize"]
    assert "nothing" in done("clean", "--yes", folder=home).out


def test_clean_leaves_work_that_a_process_is_at(home: Path) -> None:
    for name in (f".note.tmp-{os.getpid()}", ".optimize.partial"):
        (home / "runs/walk1" / name).mkdir()
    with (home / "runs/walk1/.optimize.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert "nothing" in done("clean", "--yes", folder=home).out
    entries = json.loads(done("clean", "--json", folder=home).out)["entries"]
    assert sorted(Path(entry["path"]).name for entry in entries) == [".optimize.lock", ".optimize.partial"]


def test_clean_goes_to_stale_and_orphaned_artifacts_when_asked_and_leaves_foreign_files(home: Path) -> None:
    make("walk1/evaluate", "evaluate", {"best": 0.1}, above="walk1/optimize")
    make("grandchild", "evaluate", {"best": 0.1}, above="walk1/evaluate")
    make("walk0/optimize", "optimize", {"best": 0.4}, force=True)
    (home / "runs/walk0/evaluate/mine.txt").write_text("notes")
    (home / "outside").mkdir()
    (home / "outside/keep").write_text("x")
    (home / "runs/.link.partial").symlink_to(home / "outside")
    for path in (home / "runs/walk1/optimize").iterdir():
        path.unlink()
    (home / "runs/walk1/optimize").rmdir()
    assert "stale: runs/walk0/optimize was built anew" in done("clean", "stale=true", folder=home).out
    assert "orphaned: runs/walk1/optimize is gone" in done("clean", "orphaned=true", folder=home).out
    assert "grandchild" in done("clean", "orphaned=true", folder=home).out
    done("clean", "stale=true", "orphaned=true", "--yes", folder=home)
    assert (home / "outside/keep").is_file() and not (home / "runs/.link.partial").is_symlink()
    assert [path.name for path in (home / "runs/walk0/evaluate").iterdir()] == ["mine.txt"]
    assert listed("sort=name", folder=home) == ["walk0/optimize", "walk2/optimize"]


def test_a_wrong_word_of_clean_is_one_line(home: Path) -> None:
    assert "there is name, orphaned, stale" in refused("clean", "all=true", folder=home)
    assert "must be true or false" in refused("clean", "stale=yes", folder=home)


@pytest.mark.parametrize("kind", ["iterate", "compare"])
@pytest.mark.parametrize("command", ["show", "lineage"])
def test_the_name_of_a_whole_run_means_its_main_artifact(home: Path, command: str, kind: str) -> None:
    for number in (1, 2):
        make(f"whole/trial_{number}/optimize", "optimize", {"best": 0.2})
    make(f"whole/{kind}", kind, {"best": 0.2})
    assert f"whole/{kind}" in "".join(done(command, "whole", folder=home)[1:])
