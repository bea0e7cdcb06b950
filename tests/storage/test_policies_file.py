from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gsl.errors import ArtifactError
from gsl.storage.policies import Policies, PolicyRecord, read_policies, write_policies

POLICIES = Policies(
    policy={"_target_": "gsl.policies.walk_engine.WalkEngine", "feedback": True},
    task={"_target_": "gsl.tasks.walk.Walk"},
    records=(
        PolicyRecord("initial", {"step_height": 0.1 + 0.2, "period": 1 / 3}),
        PolicyRecord("generation_03", {"step_height": -0.0, "period": 5e-324}, 3, 0.25, {"candidate": 7}),
    ),
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_policies(tmp_path / "policies.json", POLICIES)
    return tmp_path / "policies.json"


def test_what_is_written_is_read_to_the_bit(path: Path) -> None:
    stored = read_policies(path)
    assert stored == POLICIES
    assert [record.parameters["period"].hex() for record in stored.records] == [(1 / 3).hex(), (5e-324).hex()]


def test_same_policies_same_bytes(path: Path) -> None:
    write_policies(path.with_name("again"), read_policies(path))
    assert path.with_name("again").read_bytes() == path.read_bytes()


def with_value(value: Any) -> Callable[[dict[str, Any]], None]:
    return lambda stored: stored["policies"][1]["parameters"].update(period=value)


REJECTED: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "nan": (with_value(float("nan")), "generation_03: period"),
    "infinity": (with_value(float("-inf")), "generation_03: period"),
    "null": (with_value(None), "generation_03: period"),
    "text": (with_value("fast"), "generation_03: period"),
    "truth": (with_value(True), "generation_03: period"),
    "a value that is not finite": (lambda stored: stored["policies"][0].update(value_sim=float("nan")), "value_sim"),
    "another version": (lambda stored: stored.update(schema_version=2), "schema_version 2"),
    "no version": (lambda stored: stored.pop("schema_version"), "schema_version None"),
    "no policy": (lambda stored: stored.pop("policy"), "policy"),
    "a policy without target": (lambda stored: stored["policy"].pop("_target_"), "_target_"),
    "no records": (lambda stored: stored["policies"].clear(), "no policy"),
    "an unknown entry": (lambda stored: stored["policies"][0].update(speed=1), "speed"),
    "one name twice": (lambda stored: stored["policies"][0].update(name="generation_03"), "occurs twice"),
    "a parameter missing": (lambda stored: stored["policies"][1]["parameters"].pop("period"), "period"),
}


@pytest.mark.parametrize(("change", "problem"), REJECTED.values(), ids=REJECTED.keys())
def test_a_file_that_breaks_the_contract_is_refused(
    path: Path, change: Callable[[dict[str, Any]], Any], problem: str
) -> None:
    stored = json.loads(path.read_text())
    change(stored)
    path.write_text(json.dumps(stored))
    with pytest.raises(ArtifactError, match=problem) as caught:
        read_policies(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("contents", [b"", b"{", b"\xff\xfe", b"[]"])
def test_what_is_no_policy_file_is_refused(path: Path, contents: bytes) -> None:
    path.write_bytes(contents)
    with pytest.raises(ArtifactError):
        read_policies(path)


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match="does not exist"):
        read_policies(tmp_path / "policies.json")
    with pytest.raises(ArtifactError):
        read_policies(tmp_path)


def test_what_a_reader_would_refuse_is_not_written(tmp_path: Path) -> None:
    record = dataclasses.replace(POLICIES.records[0], parameters={"period": float("nan")})
    with pytest.raises(ArtifactError, match="period"):
        write_policies(tmp_path / "policies.json", dataclasses.replace(POLICIES, records=(record,)))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "damage", [{"generation": {"a": 1}}, {"generation": 1.5}, {"generation": True}, {"notes": [1]}]
)
def test_a_generation_is_a_whole_number_and_notes_have_names(damage: dict[str, object], tmp_path: Path) -> None:
    path = tmp_path / "policies.json"
    write_policies(path, Policies({"_target_": "x"}, "walk", (PolicyRecord("pi0", {"a": 1.0}),)))
    stored = json.loads(path.read_text())
    path.write_text(json.dumps({**stored, "policies": [{**stored["policies"][0], **damage}]}))
    with pytest.raises(ArtifactError, match="generation is no whole number, or its notes"):
        read_policies(path)
