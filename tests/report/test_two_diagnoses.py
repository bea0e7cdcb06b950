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
    assert table.title == "causes and suspects (causes in a/diagnose, unknown in b/diagnose)"
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


def local(effect: str, joint: str, **parameters: tuple[float, float]) -> dict[str, Any]:
    return {**cause(effect, "servo", **parameters), "scope": joint, "joints": [joint]}


def test_an_effect_of_other_joints_is_no_effect_of_one_alone() -> None:
    first = {"verdict": "causes", "causes": [FRICTION, local("backlash", "a", width=(0.02, 0.001))]}
    second = {"verdict": "causes", "causes": [local("coulomb_friction", "b", torque=(0.3, 0.01))]}
    rows = set_side_by_side(first, second)
    assert [(row["cause"], row["elsewhere"]) for row in rows] == [
        ("coulomb friction of all joints", True),
        ("coulomb friction of b", True),  # beside the other one
        ("backlash of a", False),
    ]
    table = table_of_two(rows, ("causes", "causes"), ("x", "y"))
    assert [row[-1] for row in table.rows] == ["elsewhere", "elsewhere", "in one alone"]
    assert "Elsewhere: the other one has this effect, too, and in other joints." in str(table.caption)


def test_another_parameter_of_the_same_cause_is_not_elsewhere() -> None:
    first = {"causes": [cause("servo_gain", "servo", kp=(0.5, 0.02), kd=(0.4, 0.1))]}
    second = {"causes": [cause("servo_gain", "servo", kp=(0.5, 0.02))]}
    rows = {row["parameter"]: (row["alike"], row["elsewhere"]) for row in set_side_by_side(first, second)}
    assert rows == {"kp": (True, False), "kd": (None, False)}


def test_suspects_and_causes_that_a_log_cannot_tell_apart_are_called_so() -> None:
    groups = [["backlash", "coulomb_friction"], ["armature", "backlash"]]
    torn = {"verdict": "inseparable", "causes": [FRICTION], "inseparable": groups}
    rows = set_side_by_side(torn, SECOND)
    assert [(row["first_is"], row["second_is"]) for row in rows][:2] == [
        ("cause or backlash", "suspect"),
        (None, "suspect"),
    ]
    table = table_of_two(rows, ("inseparable", "unknown"), ("x", "y"))
    assert table.title == "causes and suspects (inseparable in x, unknown in y)"
    assert [cell.rpartition("), ")[2] for cell in table.rows[0][3:5]] == ["or backlash", "suspect"]
    assert str(table.caption).endswith("Suspect: no cause is named there, and this comes nearest.")
    plain = table_of_two(set_side_by_side(FIRST, FIRST), ("causes", "causes"), ("x", "y"))
    assert plain.title == "causes (causes in x, causes in y)"
    assert not any("cause" in cell or "suspect" in cell for row in plain.rows for cell in row[3:])
