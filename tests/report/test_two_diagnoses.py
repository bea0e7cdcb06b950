"""Two diagnoses side by side: what their causes share, and what is of one alone."""

import math
from typing import Any

import pytest

from gsl.report.diagnosis_two import set_side_by_side, table_of_two


def cause(effect: str, kind: str, **parameters: tuple[float, float]) -> dict[str, Any]:
    fitted = {
        name: {"value": value, "low": value - half, "high": value + half, "unit": ""}
        for name, (value, half) in parameters.items()
    }
    return {"effect": effect, "kind": kind, "scope": "all", "joints": ["a", "b"], "fixed": {}, "parameters": fitted}


FRICTION = cause("coulomb_friction", "servo", torque=(0.20, 0.02))
FIRST = {"verdict": "causes", "causes": [FRICTION, cause("servo_gain", "servo", kp=(0.5, 0.02), kd=(0.4, 0.1))]}
SECOND = {
    "verdict": "unknown",
    "causes": [],
    "suspects": [
        cause("coulomb_friction", "servo", torque=(0.22, 0.01)),
        cause("servo_gain", "servo", kp=(0.6, 0.02), kd=(0.5, 0.1)),
        cause("command_latency", "command", delay=(0.034, 0.001)),
    ],
}


def test_values_are_alike_where_the_interval_of_their_difference_holds_nothing() -> None:
    rows = {(row["cause"], row["parameter"]): row for row in set_side_by_side(FIRST, SECOND)}
    alike = {parameter: row["alike"] for (_, parameter), row in rows.items()}
    assert alike == {"torque": True, "kp": False, "kd": True, "delay": None}
    late = rows["command latency of all joints", "delay"]
    assert late["sits"] == "bus, controller or logger" and late["first"] is None and late["second"]["value"] == 0.034


def test_the_table_says_what_is_of_one_alone() -> None:
    table = table_of_two(set_side_by_side(FIRST, SECOND), ("causes", "unknown"), ("a/diagnose", "b/diagnose"))
    assert table.title == "causes (causes in a/diagnose, unknown in b/diagnose)"
    assert [row[-1] for row in table.rows] == ["alike", "differs", "alike", "in one alone"]
    assert [row[3] for row in table.rows][-1] == "–"


def test_nothing_is_no_row() -> None:
    assert set_side_by_side({"verdict": "no_gap"}, {"verdict": "no_gap"}) == []


UNSURE = cause("servo_gain", "servo", kp=(0.5, 0.02))


@pytest.mark.parametrize(
    "damage", [{"value": None}, {"value": math.nan}, {"low": None}, {"high": 1e308}, {"unit": "rad"}]
)
def test_a_value_of_which_too_little_is_known_is_neither_alike_nor_different(damage: dict[str, Any]) -> None:
    plain = {"verdict": "causes", "causes": [UNSURE]}
    strange = {**UNSURE, "parameters": {"kp": {**UNSURE["parameters"]["kp"], **damage}}}
    other = {"verdict": "causes", "causes": [strange]}
    assert [row["alike"] for row in set_side_by_side(plain, other)] == [None]
    assert [row[-1] for row in table_of_two(set_side_by_side(plain, other), ("causes",) * 2, ("a", "b")).rows] == ["–"]


def test_a_table_has_an_end() -> None:
    many = [cause("coulomb_friction", "servo", **{f"p{k}": (0.1, 0.01)}) for k in range(200)]
    table = table_of_two(set_side_by_side({"causes": many}, {"causes": many}), ("causes",) * 2, ("a", "b"))
    assert len(table.rows) == 50 and str(table.caption).startswith("150 more are not shown.")
