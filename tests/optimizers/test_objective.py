"""The objective of a search: the mean of a candidate's episodes or of the worst of them, against its definition."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenarios import AIR, QUIET, REACH

from gsl.errors import ConfigError
from gsl.grounding.none import NoGrounding
from gsl.optimizers.cma_es import CmaEs
from gsl.optimizers.objective import check_objective, objective_values, worst_mean
from gsl.optimizers.trpo import Trpo
from gsl.stages.optimize import BEST, Optimize
from gsl.storage.generation_log import FILE, Generation, GenerationLog
from gsl.storage.policies import read_policies
from gsl.tasks.arm import Arm

pytestmark = pytest.mark.slow


def by_definition(values: np.ndarray, share: float) -> float:
    """The greatest t - E[(t - v)+] / share, which Rockafellar and Uryasev show to be the conditional value at risk."""
    return max(float(t - np.maximum(t - values, 0.0).mean() / share) for t in values)


@pytest.mark.parametrize("share", [0.2, 0.25, 0.3, 0.5, 0.77, 1.0])
def test_the_worst_share_is_the_conditional_value_at_risk(share: float) -> None:
    values = np.random.default_rng(0).normal(size=(20, 9))
    np.testing.assert_allclose(worst_mean(values, share), [by_definition(row, share) for row in values], rtol=1e-12)


def test_all_of_them_are_the_mean_and_less_than_an_episode_is_the_worst() -> None:
    values = np.random.default_rng(1).normal(size=(5, 4))
    np.testing.assert_allclose(worst_mean(values, 1.0), values.mean(axis=1))
    np.testing.assert_array_equal(worst_mean(values, 0.1), values.min(axis=1))
    np.testing.assert_array_equal(objective_values(values, "mean", 0.1), values.mean(axis=1))
    np.testing.assert_array_equal(objective_values(values, "cvar", 0.25), values.min(axis=1))


def search(objective: str, quantile: float = 0.25) -> Optimize:
    """A short one, whose starts are noisy so that episodes differ."""
    optimizer, world = CmaEs(candidates=6, generations=3, sigma=0.2), replace(AIR, start_noise=0.3)
    return Optimize(
        world, Arm(duration=0.6), REACH, NoGrounding(), optimizer, rollouts=4, workers=1,
        objective=objective, quantile=quantile,
    )  # fmt: skip


def searched(objective: str, folder: Path, quantile: float = 0.25) -> tuple[dict, list[dict]]:
    folder.mkdir()
    metrics = dict(search(objective, quantile).run(folder, QUIET))
    return metrics, [json.loads(line) for line in (folder / FILE).read_text().splitlines()]


def test_a_search_maximises_it_and_tells_the_mean(tmp_path: Path) -> None:
    metrics, generations = searched("cvar", tmp_path / "cvar")
    _, by_mean = searched("mean", tmp_path / "mean")
    assert set(by_mean[0]) == {"number", "values", "falls", "chain"}
    assert generations[0]["means"] == by_mean[0]["values"]  # the same candidates, seeds and episodes
    assert all(worst < mean for worst, mean in zip(generations[0]["values"], by_mean[0]["values"], strict=True))
    winners = [int(np.argmax(generation["values"])) for generation in generations]
    values = [record.value_sim for record in read_policies(tmp_path / "cvar/policies.json").records[1:]]
    assert values == [generation["means"][k] for generation, k in zip(generations, winners, strict=True)]
    last = max(reversed(range(3)), key=lambda index: max(generations[index]["values"]))
    assert metrics["best_cvar_sim"] == max(generations[last]["values"])
    assert metrics["best_value_sim"] == values[last]
    assert [record.name for record in read_policies(tmp_path / "cvar" / BEST).records] == [f"generation_{last + 1:02d}"]
    whole, _ = searched("cvar", tmp_path / "whole", 1.0)
    assert whole["best_cvar_sim"] == pytest.approx(whole["best_value_sim"])


def test_a_search_with_it_goes_on_from_its_log(tmp_path: Path) -> None:
    searched("cvar", tmp_path / "one")
    whole, log = (tmp_path / "one/policies.json").read_bytes(), tmp_path / "one" / FILE
    lines = log.read_text().splitlines(keepends=True)
    log.write_text(lines[0])
    search("cvar").run(tmp_path / "one", QUIET)
    assert (tmp_path / "one/policies.json").read_bytes() == whole
    GenerationLog(tmp_path).append(Generation(0, [1.0], [0], [2.0]))
    assert GenerationLog(tmp_path).read(0) == Generation(0, [1.0], [0], [2.0])


def test_a_learner_knows_the_mean_alone() -> None:
    with pytest.raises(ConfigError, match="objective.*is for a search such as cma_es"):
        check_objective("cvar", Trpo(steps=1024))
    check_objective("mean", Trpo(steps=1024))
