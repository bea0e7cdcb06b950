from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from gsl.core.checkpoint import read_checkpoint
from gsl.errors import ArtifactError
from gsl.storage.checkpoints import write_checkpoint

ARRAYS = {
    "weights.0": np.random.default_rng(0).normal(size=(4, 3)),
    "transposed": np.arange(6.0).reshape(2, 3).T,
    "scale": np.float32(3.0).reshape(()),
    "count": np.arange(3),
}
METADATA = {"kind": "forward", "joints": ["LKneePitch"], "history": 4}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_checkpoint(tmp_path / "model.safetensors", ARRAYS, METADATA)
    return tmp_path / "model.safetensors"


def test_what_is_written_is_read_to_the_bit(path: Path) -> None:
    arrays, metadata = read_checkpoint(path, kind="forward")
    assert metadata == METADATA
    assert arrays.keys() == ARRAYS.keys()
    for name, values in arrays.items():
        np.testing.assert_array_equal(values, ARRAYS[name], strict=True)


def test_same_model_same_bytes(path: Path) -> None:
    again = path.with_name("again")
    write_checkpoint(again, dict(reversed(ARRAYS.items())), dict(reversed(METADATA.items())))
    assert again.read_bytes() == path.read_bytes()


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_weights_that_are_not_finite_are_refused_both_ways(path: Path, wrong: float) -> None:
    arrays = {"weights": np.array([1.0, wrong])}
    with pytest.raises(ArtifactError, match="weights .*not finite"):
        write_checkpoint(path.with_name("new"), arrays, METADATA)
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]
    save_file(arrays, path, metadata={"gsl": json.dumps({**METADATA, "schema_version": 1})})
    with pytest.raises(ArtifactError, match="weights .*not finite"):
        read_checkpoint(path, kind="forward")


def test_another_kind_is_refused_with_both_names(path: Path) -> None:
    with pytest.raises(ArtifactError, match="holds forward, but inverse is needed"):
        read_checkpoint(path, kind="inverse")


@pytest.mark.parametrize("share", [0.0, 0.2, 0.99])
def test_a_truncated_checkpoint_is_refused(path: Path, share: float) -> None:
    contents = path.read_bytes()
    path.write_bytes(contents[: int(len(contents) * share)])
    with pytest.raises(ArtifactError, match="truncated"):
        read_checkpoint(path, kind="forward")


@pytest.mark.parametrize("contents", [b"PK\x03\x04" + b"x" * 100, b"\x80\x02}q\x00."])
def test_a_pickle_or_an_archive_is_refused(path: Path, contents: bytes) -> None:
    path.write_bytes(contents)
    with pytest.raises(ArtifactError, match="not a checkpoint"):
        read_checkpoint(path, kind="forward")


@pytest.mark.parametrize(
    ("metadata", "problem"),
    [
        (None, "no metadata"),
        ({"format": "pt"}, "no metadata"),
        ({"gsl": "{"}, "not JSON"),
        ({"gsl": "[]"}, "schema_version"),
        ({"gsl": '{"schema_version": 2, "kind": "forward"}'}, "schema_version 2"),
    ],
)
def test_a_foreign_checkpoint_is_refused(path: Path, metadata: dict[str, str] | None, problem: str) -> None:
    save_file({"weights": np.zeros(2)}, path, metadata=metadata)
    with pytest.raises(ArtifactError, match=problem):
        read_checkpoint(path, kind="forward")


def test_a_missing_checkpoint_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match="no such checkpoint"):
        read_checkpoint(tmp_path / "model.safetensors", kind="forward")
