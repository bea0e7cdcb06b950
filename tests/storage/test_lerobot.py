"""A LeRobot data set on disk becomes trajectories in radians, whichever its version and its scale are."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from commands import done, gsl, refused

from gsl.storage.lerobot.encoder_steps import find_range, on_degrees
from gsl.storage.trajectories import read

pytestmark = pytest.mark.slow

NAMES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
OURS = ("Rotation", "Pitch", "Elbow", "Wrist_Pitch", "Wrist_Roll", "Jaw")
RANGES = {"shoulder_pan": 2701, "shoulder_lift": 2384, "elbow_flex": 2230, "wrist_flex": 2296}
RANGES |= {"wrist_roll": 4095, "gripper": 1424}
LOW = {name: 2047 - ticks // 2 for name, ticks in RANGES.items()}
FPS, FRAMES = 30, 150
STEP = 360.0 / 4095.0


def write_data_set(
    folder: Path,
    version: str,
    episodes: list[tuple[np.ndarray, np.ndarray]],
    names: Any = tuple(f"{name}.pos" for name in NAMES),
    **info: Any,
) -> Path:
    """Write what LeRobot's recorder writes, less its videos: actions and states, each (T, n), by episode."""
    fps, v3 = info.get("fps", FPS), version.startswith("v3")
    width = episodes[0][0].shape[1]
    frames = [_frames(index, fps, *episode) for index, episode in enumerate(episodes)]
    lengths = [len(action) for action, _ in episodes]
    (folder / "meta").mkdir(parents=True)
    if v3:
        place = folder / "data/chunk-000/file-000.parquet"
        place.parent.mkdir(parents=True)
        pq.write_table(pa.concat_tables(frames), place)
        rows = {
            "episode_index": list(range(len(lengths))),
            "tasks": [["wave"]] * len(lengths),
            "length": lengths,
            "data/chunk_index": [0] * len(lengths),
            "data/file_index": [0] * len(lengths),
            "stats/action/max": [[1.0]] * len(lengths),
        }
        (folder / "meta/episodes/chunk-000").mkdir(parents=True)
        pq.write_table(pa.table(rows), folder / "meta/episodes/chunk-000/file-000.parquet")
    else:
        (folder / "data/chunk-000").mkdir(parents=True)
        for index, table in enumerate(frames):
            pq.write_table(table, folder / f"data/chunk-000/episode_{index:06d}.parquet")
        lines = [{"episode_index": k, "tasks": ["wave"], "length": length} for k, length in enumerate(lengths)]
        (folder / "meta/episodes.jsonl").write_text("\n".join(map(json.dumps, lines)) + "\n")
    feature = {"dtype": "float32", "shape": [width], "names": names}
    about: dict[str, Any] = {
        "codebase_version": version,
        "robot_type": "so101_follower",
        "total_episodes": len(lengths),
        "fps": fps,
        "chunks_size": 1000,
        "features": {"action": feature, "observation.state": feature, "timestamp": {"dtype": "float32", "shape": [1]}},
        **info,
    }
    (folder / "meta/info.json").write_text(json.dumps(about))
    return folder


def _frames(index: int, fps: float, action: np.ndarray, state: np.ndarray) -> pa.Table:
    count = len(action)

    def listed(values: np.ndarray) -> pa.Array:
        return pa.FixedSizeListArray.from_arrays(pa.array(values.astype(np.float32).ravel()), values.shape[1])

    columns = {
        "action": listed(action),
        "observation.state": listed(state),
        "timestamp": pa.array((np.arange(count) / fps).astype(np.float32)),
        "frame_index": pa.array(np.arange(count)),
        "episode_index": pa.array(np.full(count, index)),
    }
    return pa.table(columns)


def motion(frames: int = FRAMES, seed: int = 0) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Commands and measurements in ticks by joint; what is measured follows two frames later."""
    phase = np.random.default_rng(seed).uniform(0.0, 6.0, len(NAMES))
    time = np.arange(frames) / FPS
    commands, measured = {}, {}
    for index, name in enumerate(NAMES):
        wave = [
            LOW[name] + RANGES[name] * (0.5 + 0.3 * np.sin(2.0 * np.pi * (0.3 + 0.05 * index) * at + phase[index]))
            for at in (time, time - 2.0 / FPS)
        ]
        commands[name], measured[name] = np.round(wave[0]), np.round(wave[1])
    return commands, measured


def degrees(ticks: Mapping[str, np.ndarray]) -> np.ndarray:
    """LeRobot's degrees, its gripper as a percentage."""
    columns = [(ticks[name] - LOW[name] - RANGES[name] / 2.0) * STEP for name in NAMES[:-1]]
    return np.column_stack([*columns, (ticks["gripper"] - LOW["gripper"]) / RANGES["gripper"] * 100.0])


def percent(ticks: Mapping[str, np.ndarray]) -> np.ndarray:
    """LeRobot's percentages of each joint's calibrated range."""
    columns = [(ticks[name] - LOW[name]) / RANGES[name] * 200.0 - 100.0 for name in NAMES[:-1]]
    return np.column_stack([*columns, (ticks["gripper"] - LOW["gripper"]) / RANGES["gripper"] * 100.0])


def old_degrees(ticks: Mapping[str, np.ndarray]) -> np.ndarray:
    """Degrees with the zeros and signs of before May 2025; the inverse of LeRobot's own replay of such data."""
    values = degrees(ticks)
    values[:, 1] = 90.0 - values[:, 1]
    values[:, 2] = 90.0 + values[:, 2]
    return values


def radians(ticks: Mapping[str, np.ndarray]) -> np.ndarray:
    """What joints of the world so101 are at: 0 in the middle of a range, the jaw from its closed end."""
    columns = [(ticks[name] - LOW[name] - RANGES[name] / 2.0) * np.radians(STEP) for name in NAMES[:-1]]
    return np.column_stack([*columns, (ticks["gripper"] - LOW["gripper"]) * np.radians(STEP) - 0.174533])


def recorded(scale: Any, count: int = 3) -> list[tuple[np.ndarray, np.ndarray]]:
    motions = [motion(FRAMES + 10 * seed, seed) for seed in range(count)]
    return [(scale(commands), scale(measured)) for commands, measured in motions]


def calibration(path: Path) -> Path:
    """Write a calibration as LeRobot keeps it."""
    info = {
        name: {"id": k, "drive_mode": 0, "homing_offset": 7, "range_min": LOW[name], "range_max": LOW[name] + ticks}
        for k, (name, ticks) in enumerate(RANGES.items(), 1)
    }
    path.write_text(json.dumps(info))
    return path


@pytest.mark.parametrize("version", ["v2.0", "v2.1", "v3.0"])
@pytest.mark.parametrize("scale", [degrees, percent])
def test_an_arm_needs_no_mapping_in_any_version_and_scale(tmp_path: Path, version: str, scale: Any) -> None:
    write_data_set(tmp_path / "wave", version, recorded(scale))
    said = done("import", "source=wave", "name=log", folder=tmp_path)
    batch = read(tmp_path / "runs/log/import/trajectories.parquet")
    assert batch.joints == OURS and len(batch.episodes) == 3
    assert batch.control_period == pytest.approx(1.0 / FPS, abs=1e-6)
    assert batch.metadata["robot"] == "so101"
    assert [entry["file"] for entry in batch.metadata["episodes"]] == [f"wave/episode_{k:06d}" for k in range(3)]
    for seed, episode in enumerate(batch.episodes):
        commands, measured = motion(FRAMES + 10 * seed, seed)
        np.testing.assert_allclose(episode.time, np.arange(FRAMES + 10 * seed) / FPS, atol=1e-12)
        np.testing.assert_allclose(episode.position, radians(measured), atol=2e-6)
        np.testing.assert_allclose(episode.action, radians(commands)[:-1], atol=2e-6)
    assert ("percentages of the calibrated range" in said.err) == (scale is percent)


def test_the_zeros_and_signs_of_older_data_sets_are_todays(tmp_path: Path) -> None:
    names = {"motors": [f"main_{name}" for name in NAMES]}
    write_data_set(tmp_path / "old", "v2.0", recorded(old_degrees), names, robot_type="so100")
    said = done("import", "source=old", "name=log", folder=tmp_path)
    batch = read(tmp_path / "runs/log/import/trajectories.parquet")
    np.testing.assert_allclose(batch.episodes[0].position, radians(motion()[1]), atol=2e-6)
    assert batch.metadata["robot"] == "so100" and "names begin with main_" in said.err


def test_angles_that_left_the_encoders_steps_are_not_guessed(tmp_path: Path) -> None:
    blurred = [(a + 0.01 * np.pi, q + 0.03 * np.sin(np.arange(len(q)))[:, None]) for a, q in recorded(percent)]
    write_data_set(tmp_path / "wave", "v2.1", blurred)
    line = refused("import", "source=wave", folder=tmp_path)
    assert line.startswith("mapping.angles: nothing in the data set says whether its angles are degrees or percentages")
    assert "mapping.angles=deg" in line and "mapping.calibration=FILE" in line
    file = calibration(tmp_path / "arm.json")
    done("import", "source=wave", f"mapping.calibration={file}", "name=log", folder=tmp_path)
    batch = read(tmp_path / "runs/log/import/trajectories.parquet")
    np.testing.assert_allclose(batch.episodes[0].position, radians(motion()[1]), atol=1e-3)


def test_a_percentage_is_never_taken_for_degrees_nor_the_other_way_round(tmp_path: Path) -> None:
    write_data_set(tmp_path / "far", "v3.0", recorded(lambda ticks: 1.7 * degrees(ticks)))
    assert "angles are in degrees" in gsl("import", "source=far", "--check", folder=tmp_path).out
    line = refused("import", "source=far", "mapping.angles=percent", folder=tmp_path)
    assert "a percentage ends at 100: are these degrees (mapping.angles=deg)?" in line


def test_a_scale_that_the_encoders_steps_contradict_is_refused(tmp_path: Path) -> None:
    write_data_set(tmp_path / "wave", "v3.0", recorded(percent))
    for angles in ("deg", "rad"):
        line = refused("import", "source=wave", f"mapping.angles={angles}", folder=tmp_path)
        assert line == (
            f"mapping.angles = {angles}: but Rotation has the steps of a percentage, of 2701 ticks; "
            "leave mapping.angles out"
        )
    write_data_set(tmp_path / "turned", "v3.0", recorded(degrees))
    line = refused("import", "source=turned", "mapping.angles=percent", folder=tmp_path)
    assert line.endswith("has the steps of degrees; leave mapping.angles out")
    line = refused("import", "source=turned", "mapping.angles=rad", folder=tmp_path)
    assert "are these degrees (unit: deg)?" in line


def test_rounded_degrees_of_another_robot_are_no_percentages(tmp_path: Path) -> None:
    rounded = recorded(lambda ticks: np.round(0.6 * degrees(ticks), 1))
    write_data_set(tmp_path / "wave", "v2.1", rounded, robot_type="mine")
    line = refused("import", "source=wave", folder=tmp_path)
    assert line.startswith("mapping.angles: nothing in the data set says whether its angles are degrees or percentages")
    done("import", "source=wave", "mapping.angles=deg", "name=log", folder=tmp_path)


def test_a_joint_that_rests_asks_for_the_calibration(tmp_path: Path) -> None:
    still = [(a, np.where(np.arange(6) == 3, q[:1], q)) for a, q in recorded(percent)]
    write_data_set(tmp_path / "wave", "v2.1", still)
    line = refused("import", "source=wave", folder=tmp_path)
    assert "Wrist_Pitch: is a percentage of its range, and moves too little to tell which" in line
    file = calibration(tmp_path / "arm.json")
    done("import", "source=wave", f"mapping.calibration={file}", "name=log", folder=tmp_path)


def test_joints_keep_their_names_when_asked_and_other_mappings_see_the_lists(tmp_path: Path) -> None:
    write_data_set(tmp_path / "wave", "v3.0", recorded(degrees))
    done("import", "source=wave", "mapping.joints=[shoulder_pan,elbow_flex]", "name=log", folder=tmp_path)
    batch = read(tmp_path / "runs/log/import/trajectories.parquet")
    assert batch.joints == ("shoulder_pan", "elbow_flex")
    np.testing.assert_allclose(batch.episodes[0].position, radians(motion()[1])[:, [0, 2]], atol=2e-6)
    (tmp_path / "own.yaml").write_text(
        "joints: [pan]\ntime: {column: timestamp}\nsignals: {action: {column: 'action[0]', unit: deg},"
        " position: {column: observation.state.shoulder_pan.pos, unit: deg}}\nname: '{task} {episode_index}'\n"
    )
    done("import", "source=wave", "mapping=own.yaml", "name=own", folder=tmp_path)
    batch = read(tmp_path / "runs/own/import/trajectories.parquet")
    np.testing.assert_allclose(batch.episodes[0].position[:, 0], radians(motion()[1])[:, 0], atol=2e-6)
    assert [entry["policy"] for entry in batch.metadata["episodes"]] == ["wave 0", "wave 1", "wave 2"]


def test_a_data_set_without_names_is_asked_for_them(tmp_path: Path) -> None:
    write_data_set(tmp_path / "wave", "v2.0", recorded(radians), None, robot_type="reachy2")
    line = refused("import", "source=wave", folder=tmp_path)
    assert line == (
        "mapping.joints: the data set names no joints: say its 6 in order, mapping.joints=[...], and mapping.angles"
    )
    done("import", "source=wave", "mapping.joints=[a,b,c,d,e,f]", "mapping.angles=rad", "name=log", folder=tmp_path)
    batch = read(tmp_path / "runs/log/import/trajectories.parquet")
    np.testing.assert_allclose(batch.episodes[0].position, radians(motion()[1]), atol=2e-6)


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (lambda f: (f / "meta/info.json").write_text("{"), "wave/meta/info.json: cannot be read: "),
        (lambda f: (f / "meta/info.json").write_text("[]"), "wave/meta/info.json: has no features"),
        (lambda f: edit(f, codebase_version="v1.6"), "wave/meta/info.json: is v1.6; 2.0, 2.1 and 3 are read"),
        (lambda f: edit(f, fps=0), "wave/meta/info.json: fps is 0, no rate"),
        (lambda f: edit(f, data_path="{a.b}"), "wave/meta/info.json: data_path is {a.b}; data/chunk-"),
        (lambda f: next(f.glob("data/*/*1.parquet")).unlink(), "wave: 1 of 3 episodes have no file here (data/chunk-"),
        (lambda f: next(f.glob("data/*/*1.parquet")).write_bytes(b"PAR1"), "episode_000001.parquet: is not a parquet"),
        (lambda f: (f / "meta/episodes.jsonl").write_text('{"length": 3}'), "row 0: has no whole number for each of"),
        (lambda f: (f / "meta/episodes.jsonl").write_text(""), "wave: has no episode; was the recording finished"),
        (
            lambda f: (f / "meta/episodes.jsonl").write_text('{"episode_index": 0, "length": 3}\n' * 100_001),
            "wave: has more than 100,000 episodes",
        ),
        (
            lambda f: (f / "meta/episodes.jsonl").write_text('{"episode_index": 0, "length": 3}'),
            "has 150 frames of episode 0, meta says 3",
        ),
    ],
)
def test_a_damaged_data_set_is_refused_in_one_line(tmp_path: Path, harm: Any, message: str) -> None:
    harm(write_data_set(tmp_path / "wave", "v2.1", recorded(degrees)))
    assert message in refused("import", "source=wave", folder=tmp_path)


def edit(folder: Path, **info: Any) -> None:
    file = folder / "meta/info.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), **info}))


def test_what_is_typed_wrongly_gets_the_command_that_was_meant(tmp_path: Path) -> None:
    write_data_set(tmp_path / "wave", "v2.1", recorded(degrees))
    for part in ("wave/data", "wave/data/chunk-000/episode_000000.parquet", "wave/meta"):
        line = refused("import", f"source={part}", folder=tmp_path)
        assert line == f"source = {part}: is a part of a LeRobot data set; say source=wave, its folder"
    write_data_set(tmp_path / "all/jump", "v3.0", recorded(degrees, 1))
    line = refused("import", "source=all", folder=tmp_path)
    assert line == "source = all: holds a LeRobot data set; say it: source=all/jump"
    line = refused("import", "source=wave", "mapping.files='*.parquet'", folder=tmp_path)
    assert line.endswith("wave is a LeRobot data set, which says where its files are; leave it out")
    line = refused("import", "source=wave", "mapping=so101_arm", folder=tmp_path)
    assert line.endswith("wave is a LeRobot data set, which says where its files are; leave mapping= out")
    for mapping, column in (("pace", "dof_pos"), ("unitree_go2", "motor_state[{joint}].q")):
        line = refused("import", "source=wave", f"mapping={mapping}", "mapping.files=null", folder=tmp_path)
        assert line == (
            f"mapping.signals.position.column = {column}: is nothing of wave, a LeRobot data set; "
            "it needs no mapping: leave mapping= out, or say observation.state[0]"
        )
    line = refused("import", "source=wave", "mapping.joints=[shoulder_pam]", folder=tmp_path)
    assert "is no joint of the data set" in line and "shoulder_pan" in line
    line = refused("import", "source=wave", "mapping.calibration=arm.json", folder=tmp_path)
    assert line == "arm.json: cannot be read: No such file or directory"
    (tmp_path / "log.csv").write_text("time,action.a,position.a\n0,0,0\n1,1,1\n")
    line = refused("import", "source=log.csv", "mapping.angles=deg", folder=tmp_path)
    assert line == "mapping.angles: is for LeRobot data sets; log.csv has no meta/info.json"


def test_encoder_steps_tell_a_range_and_noise_tells_none() -> None:
    rng = np.random.default_rng(1)
    for ticks in (311, 1424, 2047, 4095):
        some = rng.choice(ticks, min(ticks, 200), replace=False)
        values = (some / ticks * 200.0 - 100.0).astype(np.float32)
        assert find_range(values, -100.0) == ticks and not on_degrees(values)
    assert on_degrees(((rng.choice(2000, 300) - 1000.5) * STEP).astype(np.float32))
    smooth = rng.uniform(-90.0, 90.0, 500)
    assert find_range(smooth, -100.0) is None and on_degrees(smooth) is False
    assert on_degrees(np.zeros(500)) is None
