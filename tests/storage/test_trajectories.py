from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from gsl.core.trajectory import Batch, Trajectory
from gsl.errors import GslError, TrajectoryError
from gsl.storage.trajectories import read, write

JOINTS = ("LKneePitch", "RKneePitch")


def an_episode(steps: int, rng: np.random.Generator) -> Trajectory:
    return Trajectory(
        time=np.arange(steps + 1) * 0.02,
        action=rng.normal(size=(steps, 2)),
        position=rng.normal(size=(steps + 1, 2)),
        velocity=rng.normal(size=(steps + 1, 2)),
        grounded_action=rng.normal(size=(steps, 2)),
        reward=rng.normal(size=steps),
        fell=np.arange(steps + 1) > steps - 2,
        sensors={"gyro.x": rng.normal(size=steps + 1), "enabled": np.ones(steps + 1, dtype=bool)},
    )


@pytest.fixture
def batch() -> Batch:
    rng = np.random.default_rng(0)
    metadata = {"robot": "nao", "role": "sim", "seed": 3, "world": {"period": 0.002}, "weather": "dry"}
    return Batch((an_episode(4, rng), an_episode(3, rng)), JOINTS, 0.02, metadata)


@pytest.fixture
def path(tmp_path: Path, batch: Batch) -> Path:
    write(tmp_path / "log.parquet", batch)
    return tmp_path / "log.parquet"


def test_what_is_written_is_read_to_the_bit(path: Path, batch: Batch) -> None:
    stored = read(path, joints=(*JOINTS, "HeadYaw"))
    assert (stored.joints, stored.control_period) == (batch.joints, batch.control_period)
    assert stored.metadata.items() >= batch.metadata.items()
    for episode, other in zip(stored.episodes, batch.episodes, strict=True):
        for name in ("time", "action", "position", "velocity", "grounded_action", "reward", "fell"):
            np.testing.assert_array_equal(getattr(episode, name), getattr(other, name))
        assert episode.sensors.keys() == other.sensors.keys()
        for name in episode.sensors:
            np.testing.assert_array_equal(episode.sensors[name], other.sensors[name])


def test_a_batch_without_optional_columns_makes_the_trip_too(tmp_path: Path, batch: Batch) -> None:
    bare = [
        dataclasses.replace(episode, grounded_action=None, reward=None, fell=None, sensors={})
        for episode in batch.episodes
    ]
    write(tmp_path / "bare.parquet", dataclasses.replace(batch, episodes=tuple(bare)))
    stored = read(tmp_path / "bare.parquet").episodes[1]
    assert (stored.grounded_action, stored.reward, stored.fell, dict(stored.sensors)) == (None, None, None, {})


def test_same_data_same_bytes(path: Path, tmp_path: Path, batch: Batch) -> None:
    write(tmp_path / "again.parquet", batch)
    write(tmp_path / "reread.parquet", read(path))
    assert (tmp_path / "again.parquet").read_bytes() == path.read_bytes()
    assert (tmp_path / "reread.parquet").read_bytes() == path.read_bytes()


def test_the_file_is_the_published_contract(path: Path) -> None:
    table = pq.read_table(path)
    assert table.schema.field("episode").type == table.schema.field("step").type == pa.int32()
    assert table.schema.field("action.LKneePitch").type == pa.float64()
    assert table.column("step").to_pylist() == [0, 1, 2, 3, 4, 0, 1, 2, 3]
    blank = np.isnan(table.column("grounded_action.RKneePitch").to_numpy())
    np.testing.assert_array_equal(np.flatnonzero(blank), [4, 8])
    metadata = json.loads(table.schema.metadata[b"gsl"])
    assert metadata["schema_version"] == 1
    assert metadata["joints"] == list(JOINTS)
    assert metadata["units"]["velocity"] == "rad/s"
    assert metadata.keys() >= {"robot", "control_period", "role", "source", "seed", "world", "policy", "weather"}


def test_a_column_of_ones_own_passes_with_a_unit(tmp_path: Path, batch: Batch) -> None:
    metadata = {**batch.metadata, "units": {"battery": "A"}}
    episodes = tuple(
        dataclasses.replace(
            episode, sensors={"battery": np.ones(len(episode) + 1), "battery.cell": np.ones(len(episode) + 1)}
        )
        for episode in batch.episodes
    )
    write(tmp_path / "own.parquet", dataclasses.replace(batch, episodes=episodes, metadata=metadata))
    assert set(read(tmp_path / "own.parquet").episodes[0].sensors) == {"battery", "battery.cell"}


def test_single_precision_and_null_are_read(path: Path) -> None:
    table = pq.read_table(path)
    values = table.column("action.LKneePitch").to_numpy()
    column = pa.array(np.where(np.isnan(values), 0, values), type=pa.float32(), mask=np.isnan(values))
    index = table.column_names.index("action.LKneePitch")
    pq.write_table(table.set_column(index, "action.LKneePitch", column), path)
    action = read(path).episodes[1].action
    np.testing.assert_allclose(action[:, 0], values[5:8], rtol=1e-6)


def setting(name: str, row: int, value: Any) -> Callable[[pa.Table], pa.Table]:
    def change(table: pa.Table) -> pa.Table:
        values = table.column(name).to_pylist()
        values[row] = value
        return table.set_column(table.column_names.index(name), name, pa.array(values, table.schema.field(name).type))

    return change


def saying(**changes: Any) -> Callable[[pa.Table], pa.Table]:
    def change(table: pa.Table) -> pa.Table:
        metadata = {**json.loads(table.schema.metadata[b"gsl"]), **changes}
        return table.replace_schema_metadata({b"gsl": json.dumps(metadata).encode()})

    return change


def renamed(old: str, new: str) -> Callable[[pa.Table], pa.Table]:
    def change(table: pa.Table) -> pa.Table:
        names = [new if name == old else name for name in table.column_names]
        return table.rename_columns(names).replace_schema_metadata(table.schema.metadata)

    return change


def typed(name: str, kind: pa.DataType) -> Callable[[pa.Table], pa.Table]:
    def change(table: pa.Table) -> pa.Table:
        return table.set_column(table.column_names.index(name), name, table.column(name).cast(kind))

    return change


REJECTED = {
    "nan in the middle of the actions": (setting("action.LKneePitch", 2, float("nan")), "action.LKneePitch", 2),
    "null in the middle of the actions": (setting("action.LKneePitch", 6, None), "action.LKneePitch", 6),
    "an action in the last row": (setting("action.LKneePitch", 4, 0.1), "action.LKneePitch", 4),
    "infinity in the last row": (setting("grounded_action.LKneePitch", 4, float("inf")), "grounded_action", 4),
    "a reward in the last row": (setting("reward", 8, 0.1), "reward", 8),
    "nan in a position": (setting("position.RKneePitch", 8, float("nan")), "position.RKneePitch", 8),
    "infinity in a sensor": (setting("gyro.x", 0, float("inf")), "gyro.x", 0),
    "null in a flag": (setting("fell", 1, None), "fell", 1),
    "null in a step": (setting("step", 3, None), "step", 3),
    "time that goes back": (setting("time", 3, 0.01), "time", 3),
    "time twice": (setting("time", 2, 0.02), "time", 2),
    "time that is no number": (setting("time", 0, float("nan")), "time", 0),
    "a row missing": (lambda table: pa.concat_tables([table.slice(0, 2), table.slice(3)]), "step", 2),
    "rows not sorted": (lambda table: table.take([0, 2, 1, 3, 4, 5, 6, 7, 8]), "step", 1),
    "episodes not sorted": (lambda table: pa.concat_tables([table.slice(5), table.slice(0, 5)]), "episode", 4),
    "an episode of one row": (lambda table: table.slice(0, 6), "episode", 5),
    "no rows": (lambda table: table.slice(0, 0), None, None),
    "a missing column": (lambda table: table.drop_columns(["velocity.LKneePitch"]), "velocity.LKneePitch", None),
    "half of the grounded actions": (
        lambda table: table.drop_columns(["grounded_action.LKneePitch"]),
        "grounded_action.LKneePitch",
        None,
    ),
    "a column twice": (lambda table: table.append_column("gyro.x", table.column("gyro.x")), "gyro.x", None),
    "a typing error": (renamed("gyro.x", "giro.x"), "giro.x", None),
    "an index column": (lambda table: table.append_column("index", table.column("step")), "index", None),
    "text for numbers": (typed("time", pa.string()), "time", None),
    "half precision": (typed("gyro.x", pa.float16()), "gyro.x", None),
    "a number for a flag": (typed("fell", pa.int32()), "fell", None),
    "a step that is no integer": (typed("step", pa.float64()), "step", None),
    "no metadata": (lambda table: table.replace_schema_metadata({}), None, None),
    "metadata that are not JSON": (lambda table: table.replace_schema_metadata({b"gsl": b"{"}), None, None),
    "metadata that are no mapping": (lambda table: table.replace_schema_metadata({b"gsl": b"[]"}), None, None),
    "a schema of tomorrow": (saying(schema_version=2), None, None),
    "an unknown role": (saying(role="target"), None, None),
    "no period": (saying(control_period=0), None, None),
    "no robot": (saying(robot=None), None, None),
    "joints twice": (saying(joints=["LKneePitch", "LKneePitch"]), None, None),
    "degrees": (saying(units={"position": "deg"}), "position", None),
}


@pytest.mark.parametrize(("change", "column", "row"), REJECTED.values(), ids=REJECTED.keys())
def test_a_file_that_breaks_the_contract_is_refused_in_one_line(
    path: Path, change: Callable[[pa.Table], pa.Table], column: str | None, row: int | None
) -> None:
    pq.write_table(change(pq.read_table(path)), path)
    with pytest.raises(TrajectoryError) as caught:
        read(path)
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(str(path))
    assert column is None or f"column {column}" in line
    assert caught.value.row == row


STRANGE = {
    "episodes": [5, "x", [1], [{"policy": []}], [{"conditions": [1]}]],
    "control_period": [int("9" * 290), 1e300, 1e-320, "x", [], True],
    "states": [10**9, -1, 1.5], "action_noise": ["x", []], "cells": ["x", 10**6], "robot": [{}, 5],
    "pi0_falls": [2.0, {}],
}  # fmt: skip


@pytest.mark.parametrize("key, value", [(key, value) for key, values in STRANGE.items() for value in values])
def test_metadata_of_another_kind_are_one_line(key: str, value: Any, path: Path) -> None:
    table = pq.read_table(path)
    metadata = json.loads(table.schema.metadata[b"gsl"]) | {key: value, "choices": 5}
    pq.write_table(table.replace_schema_metadata({"gsl": json.dumps(metadata)}), path)
    with pytest.raises(TrajectoryError, match=key) as error:
        read(path)
    assert len(str(error.value)) < 500


def test_a_file_of_very_many_columns_and_one_that_packs_too_well_are_refused(tmp_path: Path) -> None:
    column = pa.array(np.zeros(1))
    pq.write_table(pa.table({f"c{k}": column for k in range(10_001)}), tmp_path / "wide.parquet")
    with pytest.raises(TrajectoryError, match="has 10,001 columns"):
        read(tmp_path / "wide.parquet")
    dictionary = pa.DictionaryArray.from_arrays(pa.array(np.zeros(10_000_000, np.int8)), pa.array([0.0]))
    pq.write_table(pa.table({f"c{k}": dictionary for k in range(5)}), tmp_path / "bomb.parquet", compression="zstd")
    with pytest.raises(TrajectoryError, match="no log packs so well"):
        read(tmp_path / "bomb.parquet")


def test_a_number_that_nothing_measures_is_refused(tmp_path: Path, batch: Batch) -> None:
    first = batch.episodes[0]
    huge = dataclasses.replace(first, velocity=1e300 * np.ones_like(first.velocity))
    with pytest.raises(TrajectoryError, match="which nothing measures"):
        write(tmp_path / "huge.parquet", dataclasses.replace(batch, episodes=(huge,)))


def test_a_joint_of_another_robot_is_refused_with_the_likely_one(path: Path) -> None:
    with pytest.raises(TrajectoryError, match=r"position.RKneePitch.*no such joint, did you mean RKneePitchs"):
        read(path, joints=("LKneePitch", "RKneePitchs"))


def test_a_typing_error_is_answered_with_the_likely_name(path: Path) -> None:
    pq.write_table(renamed("gyro.x", "giro.x")(pq.read_table(path)), path)
    with pytest.raises(TrajectoryError, match="did you mean gyro.x"):
        read(path)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.99])
def test_a_truncated_file_is_refused(path: Path, share: float) -> None:
    contents = path.read_bytes()
    path.write_bytes(contents[: int(len(contents) * share)])
    with pytest.raises(TrajectoryError, match="truncated"):
        read(path)


def test_a_flipped_bit_is_noticed(path: Path) -> None:
    contents = bytearray(path.read_bytes())
    contents[len(contents) // 4] ^= 0xFF
    path.write_bytes(contents)
    with pytest.raises(TrajectoryError):
        read(path)


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match="does not exist"):
        read(tmp_path / "nothing.parquet")
    with pytest.raises(TrajectoryError, match="is a folder"):
        read(tmp_path)


def test_what_a_reader_would_refuse_is_not_written(tmp_path: Path, batch: Batch) -> None:
    first = batch.episodes[0]
    wrong = [
        dataclasses.replace(first, position=np.full_like(first.position, np.nan)),
        dataclasses.replace(first, position=first.position[:-1]),
        dataclasses.replace(first, action=first.action[:, :1]),
        dataclasses.replace(first, time=first.time[::-1]),
        dataclasses.replace(first, sensors={"giro.x": first.time}),
        dataclasses.replace(first, reward=None),
    ]
    for episode in wrong:
        with pytest.raises(TrajectoryError):
            write(tmp_path / "log.parquet", dataclasses.replace(batch, episodes=(batch.episodes[1], episode)))
    for changes in ({"episodes": ()}, {"metadata": {}}):
        with pytest.raises(TrajectoryError):
            write(tmp_path / "log.parquet", dataclasses.replace(batch, **changes))
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path, batch: Batch) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(GslError, match="cannot be written") as caught:
        write(tmp_path / "file" / "log.parquet", batch)
    assert caught.value.exit_code == 1
