"""What trials keep of the policies that they tried, and what told beforehand which of these would fall."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from gsl.core.statistics import concordance
from gsl.errors import ArtifactError
from gsl.storage.documents import write_json
from gsl_experiments.ledger_file import read
from gsl_experiments.trial import Trial, Tried
from gsl_experiments.tried import foretelling, read_tried


def test_concordance_is_the_share_of_pairs_that_agree_and_half_of_those_that_tie() -> None:
    assert concordance([1.0, 2.0, 3.0, 4.0], [0, 0, 1, 1]) == 1.0
    assert concordance([4.0, 3.0, 2.0, 1.0], [0, 0, 1, 1]) == 0.0
    assert concordance([1.0, 3.0, 3.0], [0, 0, 1]) == pytest.approx(0.75)
    assert concordance([2.0, 1.0, 3.0], [0, 1, 5]) == pytest.approx(2 / 3)  # pairs 0-1 wrong, 0-2 and 1-2 right
    assert np.isnan(concordance([1.0, 2.0], [1, 1]))


def test_what_was_tried_is_read_from_a_search_and_its_evaluation(tmp_path: Path) -> None:
    rows: list[dict[str, Any]] = [
        {"name": "pi0", "generation": None, "value_sim": None, "falls": 0, "episodes": 5, "value": 0.2},
        {"name": "generation_01", "generation": 1, "value_sim": 0.25, "falls": 1, "episodes": 3, "value": 0.1},
    ]
    (tmp_path / "evaluation.json").write_text(json.dumps({"policies": rows}))
    measured = cast(Any, SimpleNamespace(folder=tmp_path))
    assert read_tried({}, measured) == [(0, None, None, 0, 5, 0.2), (1, 0.25, None, 1, 3, 0.1)]
    drift = {"pi0": 0.125, "generation_01": 0.5}
    assert [policy.drift for policy in read_tried({"drift": drift}, measured)] == [0.125, 0.5]


def a_trial(number: int, method: str, *policies: tuple[float, float | None, int]) -> Trial:
    """A search whose policies have a promise, a drift, and falls in one to five episodes of the choice."""
    winners = [Tried(k, *policy, 1 if policy[2] else 5, 0.2) for k, policy in enumerate(policies, start=1)]
    start = Tried(0, None, 0.9, 1, 5, 0.2)  # which fell, and is not among them
    some = {"start": 0.2, "value": 0.2, "improvement": 0.0, "surely": 0.0, "returned": "pi0", "generation": 0}
    counts = {"falls": 0, "episodes": 20, "stable": len(winners), "improving": 0, "winners": len(winners)}
    rest = {"alpha": None, "refused": False, "rank": None, "real_episodes": 9, "outcome": {}, "last": {}}
    return Trial("", "w", method, 1, number, **some, **counts, **rest, tried=[start, *winners])


def test_figures_that_tell_who_falls_are_told_apart_with_intervals_over_trials() -> None:
    trials = [
        # of four pairs of one that fell and one that did not: promise 4, generation 3, drift (all alike) half
        *(a_trial(k, "gat", (0.1, 0.5, 0), (0.4, 0.5, 1), (0.2, 0.5, 0), (0.3, 0.5, 1)) for k in range(1, 5)),
        a_trial(5, "gat", (0.1, 0.5, 0), (0.4, 0.5, 1), (0.2, 0.5, 0), (0.15, 0.5, 1)),  # promise 3
        a_trial(6, "gat", (0.1, 0.5, 1), (0.2, 0.5, 1)),  # all fall, which tells nothing
        a_trial(1, "none", (0.1, None, 1), (0.2, None, 0)),
        a_trial(2, "none", (0.1, None, 0), (0.2, None, 1))._replace(tried=None),
    ]
    table = foretelling(trials)
    gat = "| w | gat | 1 | 12 of 22 | 5 of 6 | 0.95 (0.81 to 1.00) | 0.75 | 0.50 |"
    assert gat in table
    assert "| w | none | 1 | 1 of 2 | 1 of 1 | 0.00 | 0.00 |  |" in table


def test_nothing_is_told_of_trials_without_a_fall_or_of_those_that_kept_none() -> None:
    assert foretelling([a_trial(1, "gat", (0.1, 0.5, 0), (0.2, 0.5, 0))]) == ""
    assert foretelling([a_trial(1, "gat", (0.1, 0.5, 1), (0.2, 0.5, 0))._replace(tried=None)]) == ""


@pytest.mark.parametrize(
    ("rows", "problem"),
    [
        ([[0, None, None, 0, 5, 0.2]] * 2, "tried holds 2 policies"),
        ([[1, 2.0, 3.0]] * 3, "has tried.0.3"),
        ([[0, None, None, 0, 5, 0.2, 1.0]] * 3, "has tried.0"),
        ([[None, None, None, 0, 5, 0.2]] * 3, "has tried.0.0 None"),
    ],
)
def test_a_file_that_keeps_something_else_is_refused(rows: list[Any], problem: str, tmp_path: Path) -> None:
    trial, path = a_trial(1, "gat", (0.1, 0.5, 1), (0.2, 0.5, 0)), tmp_path / "trials.json"
    whole = {**trial._asdict(), "recipe": "r", "made_by": "m"}
    write_json(path, [whole])
    assert Trial.read({name: read(path, Trial)["r"][0][name] for name in Trial._fields}) == trial
    write_json(path, [{**whole, "tried": rows}])
    with pytest.raises(ArtifactError, match=f"row 1 .*{problem}"):
        read(path, Trial)
