"""A search that promised more than the real world gives is warned of, and one that kept its word is not."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from scenarios import GROUND, QUIET

from gsl.core.unit import Unit
from gsl.policies.walk_engine import WalkEngine
from gsl.report.iteration import Rounds
from gsl.rollout.promise import ROOM, promise
from gsl.stages.evaluate import Evaluate
from gsl.storage.artifact import Artifact
from gsl.storage.policies import PolicyRecord, write_policies
from gsl.storage.policy_choice import policies, record
from gsl.tasks.walk import Walk

WALK, CM = WalkEngine(), Unit(100.0, "cm/s")


def winners(*values: float | None) -> list[PolicyRecord]:
    """π0 and the winners of generations that are worth so much in simulation."""
    named = [("pi0", None), *((f"generation_{k:02d}", value) for k, value in enumerate(values, 1))]
    return [record(WALK, name, WALK.initial, value_sim=value) for name, value in named]


def measured(value: float, half: float) -> dict[str, Any]:
    return {"value": value, "interval": [value - half, value + half]}


def test_a_promise_is_broken_above_the_real_interval_and_some_room() -> None:
    for value, kept in ((0.26, True), (0.27, True), (0.285, False)):
        about = promise(winners(0.30, value), 2, measured(0.25, 0.01), CM)
        assert about is not None and bool(about["warning"]) is not kept
        assert (value > 0.26 + ROOM * value) is not kept
        assert (about["policy"], about["value_sim"], about["upper"]) == ("generation_02", value, pytest.approx(0.26))


def test_the_warning_has_both_figures() -> None:
    about = promise(winners(0.30), 1, measured(0.25, 0.01), CM)
    reached = "generation_01 gives 25.0 cm/s on the real side, 26.0 cm/s at most"
    words = f"the search promised 30.0 cm/s (generation_01), but {reached}"
    assert about is not None and about["warning"] == f"{words} (95 %)"


def test_where_pi0_is_returned_it_is_the_greatest_promise_that_was_not_kept() -> None:
    about = promise(winners(0.30, 0.35, 0.28), 0, measured(0.25, 0.01), CM)
    assert about is not None and "promised 35.0 cm/s (generation_02), but pi0 gives 25.0" in about["warning"]


def test_without_a_promise_or_an_interval_there_is_nothing_to_break() -> None:
    assert promise(winners(None), 1, measured(0.25, 0.01), CM) is None
    assert promise(winners(), 0, measured(0.25, 0.01), CM) is None
    about = promise(winners(0.4), 1, measured(0.25, float("inf")), CM)
    assert about is not None and not about["warning"]
    costs = promise(winners(-10.0), 1, measured(-20.0, 5.0), Unit())  # of a task whose values are below 0
    assert costs is not None and costs["warning"]


@pytest.mark.parametrize(("value", "kept"), [(0.9, False), (0.05, True)])
def test_an_evaluation_stores_and_tells_it(
    value: float, kept: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, task = tmp_path / "candidates.json", Walk(duration=1.4)
    write_policies(file, policies(WALK, task, winners(value)))
    metrics = Evaluate(GROUND, task, WALK, str(file), 2, 2, 3, workers=1).run(tmp_path, QUIET)
    assert metrics["promise"]["value_sim"] == value and bool(metrics["promise"]["warning"]) is not kept
    assert ("warning: the search promised 90.0 cm/s" in capsys.readouterr().err) is not kept


def test_iterations_tell_which_of_them_broke_a_promise() -> None:
    rounds = Rounds(Walk())
    for about in ({"warning": ""}, {"warning": "the search promised too much"}, None):
        summary = {"value": 0.2, "interval": [0.1, 0.3], "falls": 0, "episodes": 3}
        gain = {"value": 0.1, "interval": [0.05, 0.15], "share": 0.5}
        figures = {"best": "generation_01", "returned_value_sim": 0.3, "baseline": summary, "returned": summary}
        metrics = {**figures, "gain": gain, "real_episodes": 9, "promise": about}
        rounds.add(cast(Artifact, SimpleNamespace(metrics=metrics, folder="runs/x")), 0)
    assert rounds.metrics()["broken_promises"] == ["Iteration 2: the search promised too much."]
