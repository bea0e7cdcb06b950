"""Foreign logs become trajectories: the same motion comes out of every format, unit, clock and spelling."""

from __future__ import annotations

import gzip
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from commands import done, refused

from gsl.core.trajectory import Batch
from gsl.diagnosis.log.files import read_logs
from gsl.storage.importers.suspicions import STUCK, measure_saturation, measure_stops
from gsl.storage.trajectories import read

pytestmark = pytest.mark.slow

JOINTS = ("shoulder", "elbow")
PERIOD = 0.01
TIME = PERIOD * np.arange(301)
LAG = 0.05


def waves(time: np.ndarray) -> np.ndarray:
    return np.column_stack([0.5 * np.sin(2.0 * np.pi * 0.7 * time), 0.3 + 0.4 * np.sin(2.0 * np.pi * 1.1 * time)])


ACTION, POSITION = waves(TIME), waves(TIME - LAG)


def csv(path: Path, columns: dict[str, np.ndarray], separator: str = ",") -> Path:
    rows = zip(*columns.values(), strict=True)
    lines = [separator.join(columns), *(separator.join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def joint_columns(prefix: str, values: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{prefix}_{joint}": column for joint, column in zip(JOINTS, values.T, strict=True)}


def plain() -> dict[str, np.ndarray]:
    return {"t": TIME, **joint_columns("goal", ACTION), **joint_columns("q", POSITION)}


def mapping(file: Path, **settings: Any) -> str:
    mapping = {
        "joints": list(JOINTS),
        "time": {"column": "t"},
        "signals": {"action": "goal_{joint}", "position": "q_{joint}"},
        **settings,
    }
    file.write_text(yaml.safe_dump(mapping, sort_keys=False))
    return f"mapping={file}"


def imported(folder: Path, source: Path | str, chosen: str, *more: str) -> Batch:
    done("import", f"source={source}", chosen, "name=log", *more, folder=folder)
    return read(folder / "runs/log/import/trajectories.parquet")


def check_same(batch: Batch, tolerance: float = 1e-9) -> None:
    assert batch.joints == JOINTS
    (episode,) = batch.episodes
    np.testing.assert_allclose(episode.time, TIME, atol=tolerance)
    np.testing.assert_allclose(episode.action, ACTION[:-1], atol=tolerance)
    np.testing.assert_allclose(episode.position, POSITION, atol=tolerance)


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
def test_a_text_table_is_read_whatever_separates_its_columns(tmp_path: Path, separator: str) -> None:
    source = csv(tmp_path / "log.csv", plain(), separator)
    check_same(imported(tmp_path, source, mapping(tmp_path / "m.yaml")))


def test_decimal_commas_and_a_packed_file_are_read(tmp_path: Path) -> None:
    text = csv(tmp_path / "log.csv", plain(), ";").read_text().replace(".", ",")
    (tmp_path / "log.csv.gz").write_bytes(gzip.compress(text.encode()))
    check_same(imported(tmp_path, tmp_path / "log.csv.gz", mapping(tmp_path / "m.yaml")))


def test_columns_without_a_header_are_called_by_number(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    np.savetxt(path, np.column_stack([TIME, ACTION, POSITION]))
    signals = {"action": [1, 2], "position": [3, 4]}
    check_same(imported(tmp_path, path, mapping(tmp_path / "m.yaml", time={"column": "0"}, signals=signals)))


def test_a_document_of_nested_records_is_read(tmp_path: Path) -> None:
    rows = [
        {"t": t, "cmd": {"q": list(a)}, "state": {"q": list(q)}} for t, a, q in zip(TIME, ACTION, POSITION, strict=True)
    ]
    signals = {"action": "cmd.q", "position": ["state.q[0]", "state.q[1]"]}
    for name, text, records in (
        ("log.json", json.dumps({"run": {"rows": rows}, "kp": 7}), "run.rows"),
        ("log.jsonl", "\n".join(map(json.dumps, rows)), ""),
        ("list.json", json.dumps(rows), ""),
    ):
        (tmp_path / name).write_text(text)
        chosen = mapping(tmp_path / "m.yaml", signals=signals, records=records)
        check_same(imported(tmp_path, tmp_path / name, chosen, "force=true"))


def test_a_document_of_lists_an_npz_and_a_parquet_file_are_read(tmp_path: Path) -> None:
    import pandas

    columns = {"t": TIME, "goal": ACTION, "q": POSITION}
    lists = {name: values.tolist() for name, values in columns.items()}
    (tmp_path / "log.json").write_text(json.dumps(lists))
    np.savez(tmp_path / "log.npz", **columns)
    pandas.DataFrame(lists).to_parquet(tmp_path / "log.parquet")
    chosen = mapping(tmp_path / "m.yaml", signals={"action": "goal", "position": "q"})
    for name in ("log.json", "log.npz", "log.parquet"):
        check_same(imported(tmp_path, tmp_path / name, chosen, "force=true"))


def test_files_in_our_own_words_need_no_mapping(tmp_path: Path) -> None:
    columns = {"time": TIME}
    for group, values in (
        ("action", ACTION),
        ("position", POSITION),
        ("velocity", np.gradient(POSITION, TIME, axis=0)),
    ):
        columns |= {f"{group}.{joint}": column for joint, column in zip(JOINTS, values.T, strict=True)}
    batch = imported(tmp_path, csv(tmp_path / "log.csv", columns), "mapping=plain")
    check_same(batch)
    assert batch.metadata["velocity"] == "as logged" and batch.metadata["role"] == "imported"


def test_units_signs_zeros_and_old_names_are_converted(tmp_path: Path) -> None:
    ticks = -(POSITION[:, 1] - 0.1) * 4096 / (2.0 * np.pi) + 2048
    columns = {
        "us": TIME * 1e6 + 5e9,
        "a1": np.degrees(ACTION[:, 0]),
        "a2": ACTION[:, 1],
        "p1": np.degrees(POSITION[:, 0]),
        "p2": ticks,
        "mV": np.full(len(TIME), 7400.0),
        "on": np.ones(len(TIME)),
        "raw": np.full(len(TIME), 65535.0),
    }
    signals = {
        "action": {"column": "a{joint}", "unit": {"shoulder": "deg"}},  # the elbow is in rad
        "position": {
            "column": {"shoulder": "p1", "elbow": "p2"},
            "unit": {"shoulder": "deg", "elbow": "ticks/4096"},
            "sign": {"elbow": -1},
            "zero": {"elbow": 2048},
            "offset": {"elbow": 0.1},
        },
        "voltage": {"column": "mV", "unit": "mV"},
        "enabled": "on",
        "load": {"column": "raw", "unit": "%", "bits": 16, "factor": 0.1},
    }
    joints = {"shoulder": "1", "elbow": "2"}
    chosen = mapping(tmp_path / "m.yaml", joints=joints, time={"column": "us", "unit": "µs"}, signals=signals)
    batch = imported(tmp_path, csv(tmp_path / "log.csv", columns), chosen)
    check_same(batch, 1e-8)
    sensors = batch.episodes[0].sensors
    assert sensors["voltage"][0] == pytest.approx(7.4) and sensors["enabled"].all()
    assert sensors["load"][0] == pytest.approx(-0.1) and batch.metadata["units"]["load"] == "%"


def test_a_joint_that_slides_is_mapped_in_millimetres_and_newtons(tmp_path: Path) -> None:
    columns = {**plain(), "goal_elbow": 1e3 * ACTION[:, 1], "q_elbow": 1e3 * POSITION[:, 1], "f": TIME, "v": TIME}
    signals = {
        "action": {"column": "goal_{joint}", "unit": {"elbow": "mm"}},
        "position": {"column": "q_{joint}", "unit": {"shoulder": "rad", "elbow": "mm"}},
        "velocity": {"column": ["v", "v[0]"], "unit": {"shoulder": "rad/s", "elbow": "mm/s"}},
        "torque": {"column": ["f", "f[0]"], "unit": {"shoulder": "mNm", "elbow": "N"}},
    }
    batch = imported(tmp_path, csv(tmp_path / "log.csv", columns), mapping(tmp_path / "m.yaml", signals=signals))
    check_same(batch)
    (episode,) = batch.episodes
    np.testing.assert_allclose(episode.velocity, np.column_stack([TIME, 1e-3 * TIME]), atol=1e-12)
    np.testing.assert_allclose(episode.sensors["torque.elbow"], TIME, atol=1e-12)
    np.testing.assert_allclose(episode.sensors["torque.shoulder"], 1e-3 * TIME, atol=1e-12)
    document = json.loads((tmp_path / "runs/log/import/import.json").read_text())
    units = {channel["column"]: channel["unit"] for channel in document["channels"]}
    assert (units["position.elbow"], units["velocity.elbow"], units["torque.elbow"]) == ("m", "m/s", "N")
    columns["q_elbow"] = 1e3 * np.mod(8.0 * POSITION[:, 1], 2.0)  # the mapping alone knows that the elbow slides
    csv(tmp_path / "log.csv", columns)
    said = refused("import", "source=log.csv", f"mapping={tmp_path / 'm.yaml'}", folder=tmp_path)
    assert "position.elbow" in said and re.search(r"jumps by its range \((1\.9\d*|2) m\)", said)


@pytest.mark.parametrize("joints", [JOINTS, None])
def test_signs_and_columns_may_differ_by_joint_and_by_axis(tmp_path: Path, joints: tuple[str, ...] | None) -> None:
    columns = plain() | {"q_elbow": -POSITION[:, 1], **{f"w{axis}": k + TIME for k, axis in enumerate("abc")}}
    signals = {
        "action": "goal_{joint}",
        "position": {"column": "q_{joint}", "sign": {"elbow": -1}},
        "gyro": {"column": {"x": "wc", "y": "wb", "z": "wa"}, "sign": {"y": -1}},
    }
    chosen = mapping(tmp_path / "m.yaml", signals=signals, joints=list(joints) if joints else None)
    batch = imported(tmp_path, csv(tmp_path / "log.csv", columns), chosen)
    check_same(batch)
    sensors = batch.episodes[0].sensors
    turned = [sensors[f"gyro.{axis}"][0] for axis in "xyz"]
    assert turned == pytest.approx([2.0, -1.0, 0.0])


def test_conditions_are_of_numbers_however_they_are_written_and_unmatched_ones_are_told(tmp_path: Path) -> None:
    lists = {"t": TIME.tolist(), "goal": ACTION.tolist(), "q": POSITION.tolist(), "kp": 100.0}
    (tmp_path / "log.json").write_text(json.dumps(lists))
    soft = {"servo_gain": {"kp": 0.25}}
    chosen = mapping(
        tmp_path / "m.yaml",
        signals={"action": "goal", "position": "q"},
        about={"kp": "{kp}"},
        conditions={"kp": {100: soft, 2000: {"servo_gain": {"kp": 5.0}}}},
    )
    batch = imported(tmp_path, tmp_path / "log.json", chosen)
    assert batch.metadata["episodes"][0]["conditions"] == {"servo_gain": [{"kp": 0.25}]}
    line = "warning: mapping.conditions.kp.2000: no episode has it; kp is 100.0"
    source = f"source={tmp_path / 'log.json'}"
    assert line in done("import", source, chosen, "check=true", folder=tmp_path).out
    assert line in done("import", source, chosen, "name=again", folder=tmp_path).err


def test_two_files_are_joined_by_time_and_a_clock_that_is_ahead_is_set_back(tmp_path: Path) -> None:
    folder = tmp_path / "day_1" / "sweep"
    folder.mkdir(parents=True)
    csv(folder / "control.csv", {"t": TIME + 2.0, **joint_columns("goal", ACTION)})
    csv(folder / "state.csv", {"t": TIME, **joint_columns("q", POSITION)})
    chosen = mapping(
        tmp_path / "m.yaml",
        files={"control": "control.csv", "state": "state.csv"},
        signals={
            "action": {"file": "control", "column": "goal_{joint}"},
            "position": {"file": "state", "column": "q_{joint}"},
        },
        command_offset=2.0,
        path="day_{day}/{motion}",
        name="{motion}",
        about={"day": "{day}", "kp": 16},
    )
    batch = imported(tmp_path, tmp_path, chosen)
    check_same(batch)
    assert batch.metadata["episodes"] == [{"policy": "sweep", "day": "1", "kp": 16, "file": "day_1/sweep"}]


def test_commands_are_held_and_positions_interpolated_when_time_is_made_even(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.004, 0.012, 400))
    action, position = np.floor(4.0 * time)[:, None] * [0.1, 0.02], time[:, None] * [0.2, -0.1]
    columns = {"t": time, **joint_columns("goal", action), **joint_columns("q", position)}
    source = csv(tmp_path / "log.csv", columns)
    kept = imported(tmp_path, source, mapping(tmp_path / "m.yaml"))
    np.testing.assert_allclose(kept.episodes[0].time, time - time[0], atol=1e-12)
    assert kept.metadata["time"] == "rows kept as logged"
    even = imported(tmp_path, source, mapping(tmp_path / "m.yaml", period=0.005), "force=true")
    (episode,) = even.episodes
    assert even.control_period == 0.005 and even.metadata["time"].startswith("resampled to 0.005 s")
    np.testing.assert_allclose(np.diff(episode.time), 0.005, atol=1e-12)
    np.testing.assert_allclose(episode.position, (episode.time + time[0])[:, None] * [0.2, -0.1], atol=1e-9)
    assert set(np.unique(episode.action.round(9))) <= set(np.unique(action.round(9)))


def test_velocities_are_derived_where_there_are_none(tmp_path: Path) -> None:
    batch = imported(tmp_path, csv(tmp_path / "log.csv", plain()), mapping(tmp_path / "m.yaml"))
    slopes = np.gradient(POSITION, TIME, axis=0)
    np.testing.assert_allclose(batch.episodes[0].velocity, slopes, atol=1e-6)
    assert batch.metadata["velocity"] == "derived from positions"


def test_an_episode_is_cut_at_its_holes_and_what_precedes_the_first_command_is_dropped(tmp_path: Path) -> None:
    keep = (TIME < 1.0) | (TIME > 1.5)
    columns = {name: values[keep] for name, values in plain().items()}
    batch = imported(tmp_path, csv(tmp_path / "log.csv", columns), mapping(tmp_path / "m.yaml"))
    assert [label["part"] for label in batch.metadata["episodes"]] == [1, 2]
    assert [len(episode.time) for episode in batch.episodes] == [100, 150]


def test_a_column_can_tell_episodes_apart_and_empty_cells_can_mean_no_news(tmp_path: Path) -> None:
    columns = {name: np.concatenate([values, values]) for name, values in plain().items()}
    columns["run"] = np.repeat([3, 7], len(TIME))
    for name in ("goal_shoulder", "goal_elbow"):
        columns[name] = np.where(np.arange(len(columns[name])) % len(TIME) % 2, "", columns[name].astype(str))
    chosen = mapping(tmp_path / "m.yaml", episode="run", blanks="skip", about={"run": "{run}"})
    batch = imported(tmp_path, csv(tmp_path / "log.csv", columns), chosen)
    assert [label["run"] for label in batch.metadata["episodes"]] == [3, 7]
    np.testing.assert_allclose(batch.episodes[1].action[1], ACTION[0])
    np.testing.assert_allclose(batch.episodes[1].position, POSITION)


def test_columns_that_are_the_same_in_all_rows_of_an_episode_tell_of_it(tmp_path: Path) -> None:
    columns = {name: np.concatenate([values, values]) for name, values in plain().items()}
    columns |= {"run": np.repeat([3, 7], len(TIME)), "load": np.repeat([0.0, 0.25], len(TIME))}
    columns["motion"] = np.repeat(["slow waves", "fast"], len(TIME))
    about = {"payload": "{load}", "told": "{motion} with {load} kg"}
    chosen = mapping(tmp_path / "m.yaml", episode="run", name="{motion}", about=about)
    first, second = imported(tmp_path, csv(tmp_path / "log.csv", columns), chosen).metadata["episodes"]
    assert (first["policy"], first["payload"]) == ("slow waves", 0.0)
    assert (second["policy"], second["payload"], second["told"]) == ("fast", 0.25, "fast with 0.25 kg")


def test_the_same_log_twice_is_the_same_bytes_and_no_work(tmp_path: Path) -> None:
    source, chosen = csv(tmp_path / "log.csv", plain()), mapping(tmp_path / "m.yaml")
    done("import", f"source={source}", chosen, "name=a", folder=tmp_path)
    first = (tmp_path / "runs/a/import/trajectories.parquet").read_bytes()
    assert "(unchanged)" in done("import", f"source={source}", chosen, "name=a", folder=tmp_path).out
    done("import", f"source={source}", chosen, "name=b", folder=tmp_path)
    assert (tmp_path / "runs/b/import/trajectories.parquet").read_bytes() == first


def test_a_run_of_import_is_a_log_for_a_diagnosis(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    batch = imported(tmp_path, csv(tmp_path / "log.csv", plain()), mapping(tmp_path / "m.yaml"))
    monkeypatch.chdir(tmp_path)
    assert read_logs("log").metadata == batch.metadata


@pytest.mark.parametrize(("robot", "world"), [("so101", "so101"), ("go2", "..."), ("urdf", "..."), ("unknown", "...")])
def test_what_to_type_next_names_the_world_of_a_robot_that_has_one(tmp_path: Path, robot: str, world: str) -> None:
    source, chosen = csv(tmp_path / "log.csv", plain()), mapping(tmp_path / "m.yaml")
    said = done("import", f"source={source}", chosen, f"mapping.robot={robot}", "name=log", folder=tmp_path).out
    for command in ("audit", "diagnose"):
        assert f"\n  gsl {command} real=runs/log/import sim={world}\n" in said
    assert ("with a simulator of the robot as sim" in said) == (world == "...")


def test_a_mapping_may_lie_anywhere(tmp_path: Path) -> None:
    place = tmp_path / "my lab's" / "arm = 1"
    place.mkdir(parents=True)
    check_same(imported(tmp_path, csv(tmp_path / "log.csv", plain()), mapping(place / "m.v2.yaml")))


def test_a_check_writes_nothing_and_finds_the_lag(tmp_path: Path) -> None:
    source, chosen = csv(tmp_path / "log.csv", plain()), mapping(tmp_path / "m.yaml")
    before = sorted(tmp_path.rglob("*"))
    report = json.loads(done("import", f"source={source}", chosen, "--check", "--json", folder=tmp_path).out)
    assert sorted(tmp_path.rglob("*")) == before
    (episode,) = report["episodes"]
    assert episode["lag"] == pytest.approx(LAG, abs=0.004) and episode["rate"] == pytest.approx(100.0)
    assert report["refused"] == [] and {channel["column"] for channel in report["channels"]} >= {
        "position.elbow",
        "action.elbow",
    }
    assert "nothing is written" in done("import", f"source={source}", chosen, "check=true", folder=tmp_path).out


@pytest.mark.parametrize(
    ("name", "episodes", "joints", "seconds"),
    [("xl330_pendulum", 16, 1, 95.9), ("go2_in_air", 1, 12, 23.5), ("so101_arm", 43, 6, 4262.4)],
)
def test_the_shipped_logs_are_imported(tmp_path: Path, name: str, episodes: int, joints: int, seconds: float) -> None:
    done("import", f"mapping={name}", f"name={name}", folder=tmp_path)
    batch = read(tmp_path / f"runs/{name}/import/trajectories.parquet")
    assert (len(batch), len(batch.joints)) == (episodes, joints)
    assert sum(episode.time[-1] for episode in batch.episodes) == pytest.approx(seconds, abs=0.1)
    assert max(np.abs(episode.position).max() for episode in batch.episodes) < np.pi


def test_the_pendulum_says_what_hung_on_it(tmp_path: Path) -> None:
    done("import", "mapping=xl330_pendulum", "name=p", folder=tmp_path)
    batch = read(tmp_path / "runs/p/import/trajectories.parquet")
    labels = batch.metadata["episodes"]
    assert batch.joints == ("joint",) and batch.control_period == 0.005
    assert {label["kp"] for label in labels} == {100, 200, 400, 800}
    assert labels[0].items() >= {"mass": 0.49, "length": 0.1, "vin": 7.4, "trajectory": "sin_sin"}.items()
    off = next(
        episode for episode, label in zip(batch.episodes, labels, strict=True) if label["trajectory"] == "lift_and_drop"
    )
    assert 0.0 < np.mean(off.sensors["enabled"]) < 1.0 and off.sensors["voltage"].min() > 5.0


CLOCK = 0.02 * np.arange(1000)
SWING = 0.5 * np.sin(CLOCK)
HELD = np.minimum(CLOCK, 0.5) - np.clip(CLOCK - 18.0, 0.0, 0.5)
STEPS = np.repeat([0.0, 0.5, 0.0, 0.5, 0.2], 200)
SQUARE = 0.5 * np.sign(np.sin(8.0 * CLOCK))


def followed(command: np.ndarray, *, stop: float = 1.0, play: float = 0.0, lag: int = 4) -> np.ndarray:
    """What a joint with play and a stop does, in steps of an encoder of 12 bits."""
    middle, position = 0.0, []
    for target in np.minimum(np.concatenate([np.zeros(lag), command[:-lag]]), stop):
        middle = min(max(middle, target - play), target + play)
        position.append(middle)
    return np.asarray(np.round(np.array(position) * 4096 / (2 * np.pi)) * (2 * np.pi) / 4096)


@pytest.mark.parametrize(
    ("command", "how", "is_at_it"),
    [
        (SWING, {"stop": 0.3}, True),
        (STEPS, {"stop": 0.3}, True),
        (-STEPS, {"stop": 1.0}, False),
        (STEPS, {}, False),
        (SWING, {}, False),
        (SWING, {"play": 0.02}, False),
        (0.6 * SWING, {"play": 0.02}, False),
        (0.2 * SWING, {}, False),
        (HELD, {}, False),
        (SQUARE, {"lag": 6}, False),
    ],
)
def test_a_joint_is_at_a_stop_where_its_command_is_beyond_it(
    command: np.ndarray, how: dict[str, Any], is_at_it: bool
) -> None:
    assert (measure_stops(followed(command, **how), command) > STUCK) == is_at_it


def test_a_torque_at_its_end_while_the_command_moves_is_saturated() -> None:
    torque = np.clip(4.0 * SWING, -1.0, 1.0)
    assert measure_saturation(torque, SWING) > STUCK > measure_saturation(2.0 * SWING, SWING)


def test_commands_beside_the_positions_are_columns_that_hold_as_commands_do(tmp_path: Path) -> None:
    speeds = np.gradient(ACTION, PERIOD, axis=0)
    csv(tmp_path / "log.csv", {**plain(), **joint_columns("dq", np.rad2deg(speeds)), **joint_columns("tau", ACTION)})
    signals = {
        "action": "goal_{joint}",
        "position": "q_{joint}",
        "velocity_command": {"column": "dq_{joint}", "unit": "deg/s"},
        "torque_command": {"column": "tau_{joint}", "unit": "Nm"},
    }
    done("import", f"source={tmp_path / 'log.csv'}", mapping(tmp_path / "m.yaml", signals=signals), folder=tmp_path)
    batch = read(next((tmp_path / "runs").glob("*/import/trajectories.parquet")))
    for k, joint in enumerate(JOINTS):
        np.testing.assert_allclose(batch.episodes[0].sensors[f"velocity_command.{joint}"], speeds[:, k], atol=1e-6)
        np.testing.assert_allclose(batch.episodes[0].sensors[f"torque_command.{joint}"], ACTION[:, k], atol=1e-6)
    assert batch.metadata["units"]["velocity_command"] == "rad/s"


@pytest.mark.parametrize("name", ["velocity_command", "torque_command"])
def test_a_servo_that_follows_no_position_has_a_target_that_nothing_pulls_to(tmp_path: Path, name: str) -> None:
    csv(tmp_path / "log.csv", {"t": TIME, **joint_columns("sent", ACTION), **joint_columns("q", POSITION)})
    chosen = mapping(tmp_path / "m.yaml", signals={name: "sent_{joint}", "position": "q_{joint}"})
    said = done("import", f"source={tmp_path / 'log.csv'}", chosen, "name=log", folder=tmp_path)
    assert "hardly ever changes" not in said.err
    (episode,) = read(tmp_path / "runs/log/import/trajectories.parquet").episodes
    np.testing.assert_allclose(episode.action, np.repeat(POSITION[:1], len(ACTION) - 1, axis=0), atol=1e-6)
    for k, joint in enumerate(JOINTS):
        assert not episode.sensors[f"kp_command.{joint}"].any()
        np.testing.assert_allclose(episode.sensors[f"{name}.{joint}"], ACTION[:, k], atol=1e-6)


def test_a_log_without_them_says_nothing_of_them(tmp_path: Path) -> None:
    csv(tmp_path / "log.csv", plain())
    done("import", f"source={tmp_path / 'log.csv'}", mapping(tmp_path / "m.yaml"), folder=tmp_path)
    file = next((tmp_path / "runs").glob("*/import/trajectories.parquet"))
    assert b"_command" not in file.read_bytes() and not read(file).episodes[0].sensors
