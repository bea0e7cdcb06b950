"""The summary of a diagnosis says no more than the figures do."""

from __future__ import annotations

from typing import Any

import pytest

from gsl.diagnosis.verdict.document import doubt, summary
from gsl.diagnosis.verdict.verdict import Verdict

FOUND = Verdict("causes", (), (), 0.9, 1.0, 1.0)


def cause(probability: float) -> dict[str, Any]:
    return {"effect": "load_friction", "scope": "all", "probability": probability}


def shrunk(whole: float | None, calibrated: float | None) -> dict[str, Any]:
    return {"fraction": whole, "calibration_fraction": calibrated}


@pytest.mark.parametrize(("least", "word"), [(0.95, ""), (0.9, ""), (0.6, "probably"), (0.46, "possibly")])
def test_the_least_sure_cause_makes_the_doubt(least: float, word: str) -> None:
    assert doubt([cause(0.99), cause(least)]) == word


def test_causes_that_take_little_of_what_a_calibration_leaves_are_a_part_of_it() -> None:
    assert summary(FOUND, [cause(0.99)], shrunk(0.63, 0.54)) == (
        "A calibration of each joint removes 54 % of the gap on held-out data; a part of what it leaves is caused by "
        "load friction of all joints; together they remove 63 %."
    )
    assert "; what it leaves is possibly caused" in summary(FOUND, [cause(0.46)], shrunk(0.9, 0.5))


def test_a_calibration_that_removes_all_leaves_nothing_to_explain_but_its_own_size() -> None:
    assert summary(FOUND, [cause(0.99)], shrunk(1.0, 0.998)) == (
        "A calibration of each joint removes 100 % of the gap on held-out data as well, but costs more, its unusual "
        "values counted. The gap is caused by load friction of all joints."
    )


def test_a_calibration_that_does_harm_removes_nothing() -> None:
    assert "removes 0 % of the gap" in summary(FOUND, [cause(0.99)], shrunk(0.8, -0.2))


def test_without_held_out_figures_only_causes_are_told() -> None:
    assert (
        summary(FOUND, [cause(0.7)], shrunk(None, None)) == "The gap is probably caused by load friction of all joints."
    )
