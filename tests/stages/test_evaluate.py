"""An evaluation chooses the best stable policy and measures it again; every real episode is counted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from page_reader import Page
from scenarios import GROUND, QUIET
from scripted_walks import AsScripted, Numbered, ScriptedWorld

from gsl.errors import ArtifactError, ConfigError
from gsl.policies.linear import Linear
from gsl.policies.walk_engine import WalkEngine
from gsl.report.run_page import DRAWN
from gsl.stages.evaluate import Evaluate
from gsl.storage.policies import read_policies, write_policies
from gsl.storage.policy_choice import policies, record
from gsl.tasks.walk import Walk

WALK, TASK = WalkEngine(), Walk(duration=1.4)


def _theta(**changes: float) -> np.ndarray:
    values = dict(zip(WALK.names, WALK.initial, strict=True)) | changes
    return np.array(list(values.values()))


FAST = _theta(max_forward=0.33, max_forward_change=0.25)
FALLING = _theta(com_offset=-0.09)


def _evaluated(
    tmp_path: Path,
    thetas: dict[str, np.ndarray],
    place: tuple[Any, Any, Any] = (GROUND, TASK, WALK),
    **settings: object,
) -> tuple[dict, dict]:
    file, (_, task, policy) = tmp_path / "candidates.json", place
    write_policies(file, policies(policy, task, [record(policy, name, theta) for name, theta in thetas.items()]))
    sizes = {"episodes": 2, "check": 2, "confirmation": 3, **settings}
    metrics = Evaluate(*place, str(file), workers=1, **sizes).run(tmp_path, QUIET)
    return dict(metrics), json.loads((tmp_path / "evaluation.json").read_text())


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, dict, Path]:
    folder = tmp_path_factory.mktemp("evaluate")
    return (*_evaluated(folder, {"pi0": WALK.initial, "falling": FALLING, "fast": FAST}), folder)


def test_the_best_stable_policy_is_returned(three: tuple[dict, dict, Path]) -> None:
    metrics, table, folder = three
    assert metrics["best"] == "fast"
    assert [record.name for record in read_policies(folder / "policies.json").records] == ["fast"]
    assert metrics["gain"]["value"] == pytest.approx(metrics["returned"]["value"] - metrics["baseline"]["value"])
    assert metrics["gain"]["value"] > 0.0
    assert (metrics["stable_policies"], metrics["improving_policies"], metrics["policies"]) == (1, 1, 2)
    fresh = table["confirmation"][0]["values"]  # of π0, which the choice did not pick for being slow
    assert (
        sum(not policy["falls"] and np.mean(policy["values"]) > np.mean(fresh) for policy in table["policies"][1:]) == 1
    )


def test_a_policy_that_falls_costs_no_further_episode_and_is_worth_nothing(three: tuple[dict, dict, Path]) -> None:
    metrics, table, _ = three
    falling = table["policies"][1]
    assert falling["falls"] == 1 and falling["values"][-1] == 0.0
    assert metrics["real_episodes"] == 2 + falling["episodes"] + 2 + 2 + 3 + 3


def test_the_page_shows_the_joints_and_feet_of_what_is_reported(three: tuple[dict, dict, Path]) -> None:
    text = (three[2] / "report.html").read_text("utf-8")
    for part in ("Joint by joint: fast", "Joint by joint: π0", "fast on the real side", "π0 on the real side"):
        assert part in text
    assert "from real" not in text  # of no search, no simulator is told
    assert Page(text).tags["option"] == 2 * DRAWN and f"Shown are {DRAWN} of {len(GROUND.layout.joints)} joints" in text


def test_fresh_episodes_are_not_those_of_the_choice(three: tuple[dict, dict, Path]) -> None:
    _, table, _ = three
    chosen = {value for row in table["policies"] + table["check"] for value in row["values"] if value}
    assert chosen.isdisjoint(value for row in table["confirmation"] for value in row["values"] if value)


def test_without_a_stable_improvement_the_baseline_is_returned(tmp_path: Path) -> None:
    metrics, _ = _evaluated(tmp_path, {"pi0": WALK.initial, "falling": FALLING})
    assert metrics["best"] == "pi0" and metrics["gain"]["value"] == 0.0
    assert metrics["stable_policies"] == 0


def test_policies_of_another_family_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "policies.json"
    write_policies(file, policies(WALK, TASK, [record(WALK, "pi0", WALK.initial)]))
    other = Linear(start_at={})
    with pytest.raises(ArtifactError, match="policy="):
        Evaluate(GROUND, TASK, other, str(file), episodes=1, check=1, confirmation=2, workers=1).run(tmp_path, QUIET)


@pytest.mark.parametrize(
    ("check", "tolerated", "best", "failed"),
    [
        ((0.3, 0.2, 0.3, 0.3, 0.3, 0.3), 1.0, "fast", []),
        ((0.0, 0.2, 0.2, 0.2, 0.1, 0.1), 1.0, "pi0", ["fast", "other"]),
        ((0.14, 0.13, 0.13, 0.13, 0.13, 0.13), 1.0, "fast", []),
        ((0.12, 0.11, 0.12, 0.11, 0.12, 0.11), 1.0, "pi0", ["fast", "other"]),
        ((0.0, 0.0, 0.9, 0.0, 0.9, 0.9), 0.4, "pi0", ["fast", "other"]),
    ],
    ids=["ahead", "not surely ahead", "fewer falls", "fewer falls but slower", "falls too often"],
)
def test_where_falls_are_tolerated_a_check_has_to_be_ahead_of_the_baseline(
    tmp_path: Path,
    check: tuple[float, ...],
    tolerated: float,
    best: str,
    failed: list[str],
) -> None:
    """A high mean in the choice may be luck: the best of many policies on few episodes."""
    report = (0.2, 0.2, 0.2)
    walks = {
        "pi0": (0.1, 0.0, 0.1, *(0.35, 0.35, 0.0, 0.0, 0.0, 0.0), *report),
        "fast": (0.3, 0.3, 0.3, *check, *report),
        "other": (0.2, 0.2, 0.2, *(0.05, 0.1, 0.05, 0.1, 0.05, 0.1), *report),
        "third": (0.15, 0.2, 0.2, *(0.9,) * 6),
    }
    place = ScriptedWorld(tuple(walks.values())), AsScripted(), Numbered()
    numbers = {name: np.array([float(k)]) for k, name in enumerate(walks)}
    metrics, table = _evaluated(tmp_path, numbers, place, tolerated=tolerated, episodes=3, check=6)
    assert (metrics["best"], metrics["failed_check"]) == (best, failed)
    assert [row["name"] for row in table["check"]] == ["pi0", "fast", "other"][: 2 + len(failed) // 2]


def test_one_episode_is_no_check_of_a_policy_that_may_fall(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="check = 1: needs two episodes at least where falls are tolerated"):
        _evaluated(tmp_path, {"pi0": WALK.initial}, tolerated=0.5, check=1)
