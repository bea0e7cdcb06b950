"""The report of a diagnosis, which a stranger may have written."""

import json
from pathlib import Path
from typing import Any

import pytest

from gsl.storage.diagnosis_report import REPORT, report_of

CAUSE = {
    "effect": "backlash",
    "joints": ["elbow"],
    "scope": "elbow",
    "fixed": {},
    "parameters": {"width": {"value": 1.0}},
}
WHOLE = {"causes": [CAUSE], "suspects": [], "next_experiment": {"file": "next.json"}, "world_file": "world/x.yaml"}


def test_paths_of_a_report_are_good_from_where_the_command_runs(tmp_path: Path) -> None:
    (tmp_path / REPORT).write_text(json.dumps(WHOLE))
    assert report_of(tmp_path)["next_experiment"]["file"] == (tmp_path / "next.json").as_posix()


@pytest.mark.parametrize(
    "damage",
    [
        *({"causes": wrong} for wrong in (1, [1], "x", [{**CAUSE, "parameters": [1]}])),
        *(
            {"suspects": [{**CAUSE, **wrong}]}
            for wrong in ({"parameters": {"width": 3}}, {"joints": 5}, {"joints": [1]})
        ),
        *({"causes": [{**CAUSE, **wrong}]} for wrong in ({"scope": 3}, {"fixed": [1]}, {"effect": ["x"]})),
        *({"next_experiment": wrong} for wrong in ([1], 3, "x", {"file": [1]})),
        *({"world_file": wrong} for wrong in ([1], 3)),
        *({"inseparable": wrong} for wrong in (5, "ab", [1], ["a"], [["a", None]], {"a": 1})),
    ],
)
def test_a_report_of_another_shape_is_damaged(damage: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / REPORT).write_text(json.dumps({**WHOLE, **damage}))
    with pytest.raises(ValueError):
        report_of(tmp_path)
