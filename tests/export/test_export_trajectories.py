"""Trajectories that are exported are read again, by gsl or by the format's own library, to the number."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import done, refused

from gsl.core.trajectory import Batch, Trajectory
from gsl.storage.trajectories import read, write

pytestmark = pytest.mark.slow

JOINTS, PERIOD = ("shoulder_pan", "shoulder_lift", "elbow_flex"), 0.04


def episode(length: int, phase: float) -> Trajectory:
    time = PERIOD * np.arange(length + 1)
    position = np.sin(time[:, None] + phase + np.arange(len(JOINTS)))
    action = position[:-1] + 0.1 * np.cos(3.0 * time[:-1, None])
    velocity = np.cos(time[:, None] + phase + np.arange(len(JOINTS)))
    return Trajectory(
        time, action, position, velocity, grounded_action=action + 0.01, reward=time[1:], fell=time > 2.0,
        sensors={"voltage": 12.0 + time},
    )  # fmt: skip


@pytest.fixture
def batch(tmp_path: Path) -> Batch:
    about = {"robot": "so100", "role": "imported", "episodes": [{"motion": "sine", "gain": 3}, {"motion": "step"}]}
    kept = Batch((episode(40, 0.0), episode(55, 0.7)), JOINTS, PERIOD, about)
    write(tmp_path / "log.parquet", kept)
    return kept


def export(folder: Path, kind: str) -> Path:
    done("export", "trajectories=log.parquet", f"format={kind}", "name=out", folder=folder)
    return folder / f"runs/out/export_{kind}"


def check_alike(again: Batch, batch: Batch, *, rows: int, precision: float) -> None:
    assert len(again) == len(batch)
    for episode, other in zip(again.episodes, batch.episodes, strict=True):
        n = len(other) - (1 - rows)
        np.testing.assert_allclose(episode.position[:n], other.position[:n], atol=precision)
        np.testing.assert_allclose(episode.action[: n - 1], other.action[: n - 1], atol=precision)
        np.testing.assert_allclose(episode.velocity[:n], other.velocity[:n], atol=precision)


def test_a_lerobot_data_set_is_imported_again(batch: Batch, tmp_path: Path) -> None:
    place = export(tmp_path, "lerobot")
    info = json.loads((place / "meta/info.json").read_text(encoding="utf-8"))
    assert (info["codebase_version"], info["total_frames"], info["fps"]) == ("v3.0", 95, 25)
    frames = pd.read_parquet(place / "data/chunk-000/file-000.parquet")
    assert frames["index"].tolist() == list(range(95))
    episodes = pd.read_parquet(place / "meta/episodes/chunk-000/file-000.parquet")
    assert episodes["dataset_to_index"].tolist() == [40, 95]
    for name, feature in info["features"].items():
        assert np.atleast_1d(frames[name][0]).shape == tuple(feature["shape"]), name
    done("import", f"source={place}", "name=again", "accept=true", folder=tmp_path)
    again = read(tmp_path / "runs/again/import/trajectories.parquet")
    assert [joint.removesuffix(".pos") for joint in again.joints] == list(JOINTS)
    check_alike(again, batch, rows=0, precision=1e-6)


def test_a_lerobot_data_set_has_slides_in_metres(batch: Batch, tmp_path: Path) -> None:
    slider = JOINTS[1]
    write(tmp_path / "log.parquet", replace(batch, metadata={**batch.metadata, "slides": [slider]}))
    place = export(tmp_path, "lerobot")
    frames = pd.read_parquet(place / "data/chunk-000/file-000.parquet")
    states = np.stack(frames["observation.state"].tolist())[:40]
    np.testing.assert_allclose(states[:, 1], batch.episodes[0].position[:40, 1], atol=1e-6)
    np.testing.assert_allclose(states[:, 0], np.rad2deg(batch.episodes[0].position[:40, 0]), atol=1e-4)
    done("import", f"source={place}", "name=again", "accept=true", folder=tmp_path)
    again = read(tmp_path / "runs/again/import/trajectories.parquet")
    check_alike(again, batch, rows=0, precision=1e-6)
    assert again.metadata["slides"] == [again.joints[1]]


def test_a_csv_is_imported_again(batch: Batch, tmp_path: Path) -> None:
    place = export(tmp_path, "csv")
    table = pd.read_csv(place / "trajectories.csv")
    assert table["episode"].nunique() == len(batch)
    np.testing.assert_array_equal(
        table[[f"position.{joint}" for joint in JOINTS]].to_numpy(),
        np.concatenate([episode.position for episode in batch.episodes]),
    )
    words = ("mapping.episode=episode", "mapping.blanks=skip", "name=back")
    for source in (place / "trajectories.csv", place):  # the folder's own log, settings and metrics are no logs
        done("import", f"source={source}", *words, "force=true", folder=tmp_path)
        check_alike(read(tmp_path / "runs/back/import/trajectories.parquet"), batch, rows=0, precision=1e-9)


def test_a_bag_holds_states_and_commands_with_their_times(batch: Batch, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from gsl.storage.importers.bag_table import BagTable

    place = export(tmp_path, "mcap")
    for number, episode in enumerate(batch.episodes):
        states = BagTable(place / f"episode_{number:03d}", "/joint_states", 1e9)
        names = [f"position.{joint}" for joint in JOINTS]
        columns = states.columns(["time", *names])
        np.testing.assert_allclose(columns["time"], episode.time, atol=1e-9)
        np.testing.assert_array_equal(np.column_stack([columns[name] for name in names]), episode.position)
        commands = BagTable(place / f"episode_{number:03d}", "/joint_commands", 1e9).columns(names)
        np.testing.assert_array_equal(np.column_stack([commands[name] for name in names]), episode.action)


def test_bags_are_imported_again(batch: Batch, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    place = export(tmp_path, "mcap")
    line = refused("import", f"source={place}", folder=tmp_path)
    assert line.startswith(f"source = {place}: holds bags, such as episode_000; mapping=ros reads /joint_commands")
    line = refused("import", f"source={place}/episode_000", folder=tmp_path)
    assert "needs a mapping; mapping=ros reads /joint_commands" in line
    done("import", f"source={place}", "mapping=ros", "name=back", "accept=true", folder=tmp_path)
    check_alike(read(tmp_path / "runs/back/import/trajectories.parquet"), batch, rows=1, precision=1e-9)


@pytest.mark.filterwarnings("ignore")
def test_minari_loads_its_data_set(batch: Batch, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    minari = pytest.importorskip("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(export(tmp_path, "minari")))
    data = minari.load_dataset("gsl/trajectories-v0")
    assert (data.total_episodes, data.total_steps) == (2, 95)
    for stored, episode in zip(data, batch.episodes, strict=True):
        np.testing.assert_array_equal(stored.observations, np.hstack([episode.position, episode.velocity]))
        np.testing.assert_array_equal(stored.actions, episode.action)
        np.testing.assert_array_equal(stored.rewards, episode.reward)
        assert stored.terminations[-1] == episode.ended_in_a_fall == (not stored.truncations[-1])


SOME = [
    "the state after the last action of an episode",
    "when each row was measured",
    "what a grounding sent instead of an action",
    "rewards",
    "since when the robot lies on the ground",
    "sensors: voltage",
]  # velocities are held by every format


@pytest.mark.parametrize(
    ("kind", "held", "library"),
    [
        ("lerobot", ("when", "rewards"), "pyarrow"),
        ("csv", ("the state", "when", "what", "rewards", "since", "sensors"), "pandas"),
        ("mcap", ("the state", "when"), "rosbags"),
        ("minari", ("the state", "rewards", "since"), "minari"),
        ("rerun", ("the state", "when", "what", "rewards", "since", "sensors"), "rerun"),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_whatever_a_format_cannot_hold_is_said(
    kind: str, held: tuple[str, ...], library: str, batch: Batch, tmp_path: Path
) -> None:
    pytest.importorskip(library)
    said = (export(tmp_path, kind) / "not_held.txt").read_text("utf-8").splitlines()
    lost = [line for line in SOME if not line.startswith(held)]
    assert said[: len(lost)] == lost and said[len(lost)] == "labels of the episodes: gain, motion"
    (metadata,) = said[len(lost) + 1 :]
    assert metadata.startswith("metadata: ") and ("robot" in metadata) == (kind != "lerobot")


def test_rerun_writes_a_recording(batch: Batch, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    assert (export(tmp_path, "rerun") / "trajectories.rrd").read_bytes()[:3] == b"RRF"


def test_what_is_missing_or_wrong_is_one_line(batch: Batch, tmp_path: Path) -> None:
    assert "format=csv is of trajectories=RUN" in refused("export", "format=csv", folder=tmp_path)
    assert "format=mjcf is of world=NAME" in refused("export", "format=mjcf", folder=tmp_path)
    said = refused("export", "format=stl", "world=so101", folder=tmp_path)
    assert "must be one of" in said
    said = refused("export", "format=bam", "world=inverted_pendulum", folder=tmp_path)
    assert said == "world: has no joints with servos"
