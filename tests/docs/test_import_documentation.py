"""The examples of docs/howto/own-logs.md run as printed; that with a bag does where the library is at hand."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from commands import done, refused

from gsl.storage.trajectories import read

PAGE = (Path(__file__).parents[2] / "docs/howto/own-logs.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def test_the_example_of_the_page_runs(tmp_path: Path) -> None:
    (tmp_path / "arm.csv").write_text(blocks("csv")[0])
    (tmp_path / "arm.yaml").write_text(blocks("yaml")[0])
    for line in blocks("console")[0].splitlines():
        done(*shlex.split(line.partition("#")[0])[2:], folder=tmp_path)
    batch = read(tmp_path / "runs/my_arm/import/trajectories.parquet")
    (episode,) = batch.episodes
    assert batch.joints == ("shoulder", "elbow") and batch.control_period == 0.02
    np.testing.assert_allclose(episode.action[1], np.radians([2.0, 20.5]))
    np.testing.assert_allclose(episode.position[-1], 2.0 * np.pi / 4096 * np.array([91, 251]))
    assert episode.sensors["voltage"][0] == pytest.approx(7.41)
    assert batch.metadata["episodes"][0].items() >= {"motion": "ramp", "kp": 16}.items()


def test_a_servo_of_more_than_positions_is_imported_as_the_page_maps_it(tmp_path: Path) -> None:
    (chosen,) = (block for block in blocks("yaml") if "torque_command" in block)
    (tmp_path / "mit.yaml").write_text(chosen)
    names = [
        "t",
        *(f"{part}_{joint}" for part in ("q_des", "v_des", "tau_ff", "kp", "kd", "q") for joint in ("hip", "knee")),
    ]
    time = 0.01 * np.arange(200)
    rows = np.column_stack([time, *(np.sin(time + k) for k in range(len(names) - 1))])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=",".join(names), comments="")
    done("import", "source=log.csv", "mapping=mit.yaml", "name=arm", folder=tmp_path)
    (episode,) = read(tmp_path / "runs/arm/import/trajectories.parquet").episodes
    for place, column in enumerate(("velocity_command.hip", "velocity_command.knee", "torque_command.hip"), start=2):
        np.testing.assert_allclose(episode.sensors[column], np.sin(time + place), atol=1e-6)
    assert {"kp_command.hip", "kd_command.knee"} <= episode.sensors.keys()


def test_a_bag_without_its_library_says_what_to_install(tmp_path: Path) -> None:
    try:
        import rosbags  # noqa: F401
    except ImportError:
        (tmp_path / "log.mcap").write_bytes(b"\x89MCAP0\r\n")
        (tmp_path / "bag.yaml").write_text(blocks("yaml")[1])
        line = refused("import", "source=log.mcap", "mapping=bag.yaml", folder=tmp_path)
        assert line == "log.mcap: bags are read with the library rosbags: pip install 'gsl[ros]'"


def test_topics_of_a_bag_are_joined_by_time_and_joints_go_by_name(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    state, header = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    stamp, array = store.types["builtin_interfaces/msg/Time"], store.types["std_msgs/msg/Float64MultiArray"]
    layout = store.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    time = 0.01 * np.arange(200)
    knee, hip = 0.5 * np.sin(4.0 * time), 0.3 * np.cos(3.0 * time)
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        states = bag.add_connection("/joint_states", state.__msgtype__, typestore=store)
        commands = bag.add_connection("/commands", array.__msgtype__, typestore=store)
        for k in range(len(time)):
            at = 1_700_000_000_000_000_000 + 10_000_000 * k
            head = header(stamp=stamp(sec=at // 10**9, nanosec=at % 10**9), frame_id="")
            q = np.array([knee[k], hip[k]])
            message = state(header=head, name=["knee", "hip"], position=q, velocity=q, effort=q)
            bag.write(states, at + 2_000_000, store.serialize_cdr(message, state.__msgtype__))
            after = min(k + 5, len(time) - 1)
            data = array(layout=layout, data=np.array([hip[after], knee[after]]))
            bag.write(commands, at, store.serialize_cdr(data, array.__msgtype__))
    (tmp_path / "bag.yaml").write_text(blocks("yaml")[1])
    for source in ("bag", "bag/bag.mcap"):
        done("import", f"source={source}", "mapping=bag.yaml", "name=bag", "force=true", folder=tmp_path)
        batch = read(tmp_path / "runs/bag/import/trajectories.parquet")
        assert batch.joints == ("hip", "knee")
        np.testing.assert_allclose(batch.episodes[0].position, np.column_stack([hip, knee]), atol=1e-9)
        np.testing.assert_allclose(batch.episodes[0].action[:150, 0], hip[5:155], atol=1e-9)
    (tmp_path / "bag.yaml").write_text(blocks("yaml")[1].replace("/commands", "/cmds"))
    line = refused("import", "source=bag", "mapping=bag.yaml", folder=tmp_path)
    assert line == "bag: has no topic /cmds; its topics are /commands, /joint_states"
    line = refused("import", "source=bag", folder=tmp_path)
    assert "in a mapping of your own `file` is the topic; its topics are /commands, /joint_states" in line
