"""Metrics of steps are kept line by line beside the payload, whose hash they do not change."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from commands import done, refused

from gsl.core.step_metrics import listen_to_steps, note_step
from gsl.models.config import ModelConfig
from gsl.models.fitting import fit_mlp
from gsl.storage import manifest
from gsl.storage.artifact import build
from gsl.storage.step_metrics import StepLog, read_steps


class Climbing:
    """A stage that takes three steps, twice."""

    kind = "climb"

    def parents(self) -> Mapping[str, Path]:
        return {}

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        for height in (1.0, 2.0):
            for step in (1, 2, 3):
                note_step("climb", step, height=height * step)
        note_step("rest", 1, length=float("nan"))
        return {}


def climb(place: Path) -> Path:
    return build(Climbing(), config={}, out=place, command="", force=False, console=None).folder  # type: ignore[arg-type]


def test_each_step_is_a_line_and_a_series_that_begins_anew_another_run(tmp_path: Path) -> None:
    steps = read_steps(climb(tmp_path / "runs/a/climb"))
    assert [(step.stage, step.series, step.run, step.step) for step in steps] == [
        ("climb", "climb", run, step) for run in (1, 2) for step in (1, 2, 3)
    ] + [("climb", "rest", 1, 1)]
    assert [step.values for step in steps[3:5]] == [{"height": 2.0}, {"height": 4.0}]
    assert steps[-1].values == {"length": None}
    assert all(before.time <= after.time for before, after in zip(steps, steps[1:], strict=False))


def test_the_time_of_steps_is_no_part_of_the_contents(tmp_path: Path) -> None:
    first, second = (manifest.read(climb(tmp_path / name)) for name in ("one", "two"))
    assert first.contents == second.contents
    assert "metrics.jsonl" in first.files


def test_work_that_goes_on_keeps_the_lines_of_steps_that_it_repeats(tmp_path: Path) -> None:
    log = StepLog(tmp_path, "optimize")
    log.note("search", 1, {"best": 1.0})
    log.note("search", 2, {"best": 2.0})
    before = read_steps(tmp_path)
    with (tmp_path / "metrics.jsonl").open("a") as file:
        file.write('{"stage": "optimize", "ser')  # a kill
    again = StepLog(tmp_path, "optimize")
    for step in (1, 2, 3):
        again.note("search", step, {"best": float(step)})
    assert read_steps(tmp_path)[:2] == before
    assert [step.step for step in read_steps(tmp_path)] == [1, 2, 3]


def test_a_network_notes_every_epoch_and_is_the_same_with_a_listener(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    x = rng.normal(size=(60, 2))
    samples = x, x @ np.array([[1.0], [2.0]])
    config = ModelConfig(family="mlp", epochs=4)
    alone = fit_mlp(samples, samples, config, seed=1)
    noted: list[tuple[str, int, dict[str, float]]] = []
    with listen_to_steps(lambda *step: noted.append(step)):
        heard = fit_mlp(samples, samples, config, seed=1)
    assert [(series, step) for series, step, _ in noted] == [("network", step) for step in (1, 2, 3, 4)]
    assert alone.predict(x[0]) == heard.predict(x[0])


def test_the_command_shows_steps_and_says_in_a_line_what_is_wrong(tmp_path: Path) -> None:
    climb(tmp_path / "runs/a/climb")
    rows = json.loads(done("metrics", "a", "--json", folder=tmp_path).out)
    assert [line["values"] for line in rows["artifacts"]["a/climb"]][1] == {"height": 2.0}
    assert "height" in done("metrics", "a", folder=tmp_path).out
    assert "exists" in refused("metrics", "a", "tensorboard=runs", folder=tmp_path)
    assert "no such setting" in refused("metrics", "a", "wandb=x", folder=tmp_path)
    (tmp_path / "runs/a/climb/metrics.jsonl").write_text("[]")
    assert "damaged" in refused("metrics", "a", folder=tmp_path)


def test_a_missing_tensorboard_is_one_line(tmp_path: Path) -> None:
    try:
        import tensorboard  # noqa: F401
    except ImportError:
        climb(tmp_path / "runs/a/climb")
        assert "pip install 'gsl[tensorboard]'" in refused("metrics", "a", "tensorboard=events", folder=tmp_path)


def test_tensorboard_reads_what_is_written_for_it(tmp_path: Path) -> None:
    reader = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    folder = climb(tmp_path / "runs/a/climb")
    done("metrics", "a", "tensorboard=events", folder=tmp_path)
    events = reader.EventAccumulator(str(tmp_path / "events/a/climb"))
    events.Reload()
    assert [(event.step, event.value) for event in events.Scalars("climb_2/height")] == [(1, 2.0), (2, 4.0), (3, 6.0)]
    assert events.Scalars("climb/height")[0].wall_time == pytest.approx(read_steps(folder)[0].time)


class Searching:
    """A stage on a task whose values are shown in cm/s; its steps are done at times of its own."""

    kind, task = "optimize", SimpleNamespace(shown=100.0, unit="cm/s")
    moments = (time.time() + 3600.0, time.time() + 3601.5)

    def parents(self) -> Mapping[str, Path]:
        return {}

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        for step, (moment, best) in enumerate(zip(self.moments, (0.25, 0.5), strict=True), 1):
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(time, "time", lambda moment=moment: moment)
                note_step("search", step, best=best, falls=2.0)
        return {}


def test_metrics_are_shown_in_the_unit_of_the_task_and_from_the_start_of_the_run(tmp_path: Path) -> None:
    made = build(Searching(), config={}, out=tmp_path / "runs/a/optimize", command="", force=False, console=None)  # type: ignore[arg-type]
    begun = datetime.fromisoformat(made.manifest.created).timestamp()
    lines = [line.split() for line in done("metrics", "a", folder=tmp_path).out.splitlines()]
    assert ["run", "step", "time", "[s]", "best", "[cm/s]", "falls"] in lines
    for step, (moment, best) in enumerate(zip(Searching.moments, ("25.0", "50.0"), strict=True), 1):
        assert ["1", str(step), f"{round(moment, 3) - begun:.1f}", best, "2"] in lines
