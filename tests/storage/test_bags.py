"""Bags whose messages hold arrays of messages: a robot's motors by number, the points of a trajectory by joint."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from commands import done, refused

from gsl.storage.trajectories import read

pytest.importorskip("rosbags")
pytestmark = pytest.mark.slow

TIME = 0.01 * np.arange(200)
GOAL = np.column_stack([0.5 * np.sin(4.0 * TIME), 0.3 * np.cos(3.0 * TIME)])
MEASURED = np.column_stack([0.5 * np.sin(4.0 * (TIME - 0.03)), 0.3 * np.cos(3.0 * (TIME - 0.03))])
START = 1_700_000_000_000_000_000
MOTORS = {
    "unitree_go/msg/MotorCmd": "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 tau\nfloat32 kp\nfloat32 kd\n",
    "unitree_go/msg/MotorState": "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 tau_est\nint8 temperature\n",
    "unitree_go/msg/LowCmd": "uint8[2] head\nunitree_go/MotorCmd[13] motor_cmd\nuint32 crc\n",
    "unitree_go/msg/LowState": "uint8[2] head\nunitree_go/MotorState[13] motor_state\nuint32 tick\n",
}


def mapping(folder: Path, **more: Any) -> str:
    (folder / "m.yaml").write_text(yaml.safe_dump(more, sort_keys=False))
    return "mapping=m.yaml"


def ros2_store() -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in MOTORS.items():
        store.register(get_types_from_msg(text, name))
    return store


def write_ros2(folder: Path, store: Any, topics: dict[str, list[Any]], plugin: str) -> Path:
    from rosbags.rosbag2 import StoragePlugin, Writer

    with Writer(folder, version=9, storage_plugin=StoragePlugin[plugin]) as bag:
        kinds = {topic: messages[0].__msgtype__ for topic, messages in topics.items()}
        places = {topic: bag.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
        for row in range(len(TIME)):
            for topic, messages in topics.items():
                message = messages[row]
                bag.write(places[topic], START + 10_000_000 * row, store.serialize_cdr(message, message.__msgtype__))
    return folder


@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
def test_motors_in_an_array_of_messages_are_named_by_number(tmp_path: Path, plugin: str) -> None:
    store = ros2_store()
    command, state = store.types["unitree_go/msg/MotorCmd"], store.types["unitree_go/msg/MotorState"]
    low_cmd, low_state = store.types["unitree_go/msg/LowCmd"], store.types["unitree_go/msg/LowState"]
    head, rest = np.array([254, 239], np.uint8), 0.0
    topics: dict[str, list[Any]] = {"/lowcmd": [], "/lowstate": []}
    for goal, q in zip(GOAL, MEASURED, strict=True):
        commands = [command(1, goal_now, 0.0, 0.0, 20.0, 1.5) for goal_now in (rest, *goal, *[0.0] * 10)]
        states = [state(1, position_now, 0.1, 0.2, 30) for position_now in (rest, *q, *0.01 * np.arange(3, 13))]
        topics["/lowcmd"].append(low_cmd(head, commands, 0))
        topics["/lowstate"].append(low_state(head, states, 0))
    write_ros2(tmp_path / "bag", store, topics, plugin)
    signals = {
        "action": {"file": "/lowcmd", "column": "motor_cmd[{joint}].q"},
        "position": {"file": "/lowstate", "column": "motor_state[{joint}].q"},
        "torque": {"file": "/lowstate", "column": "motor_state[{joint}].tau_est", "unit": "Nm"},
    }
    chosen = mapping(tmp_path, joints={"hip": 1, "knee": 2}, time="time", signals=signals)
    done("import", "source=bag", chosen, "name=log", folder=tmp_path)
    batch = read(tmp_path / "runs/log/import/trajectories.parquet")
    assert batch.joints == ("hip", "knee")
    np.testing.assert_allclose(batch.episodes[0].position, MEASURED, atol=1e-6)
    np.testing.assert_allclose(batch.episodes[0].action, GOAL[:-1], atol=1e-6)
    np.testing.assert_allclose(batch.episodes[0].sensors["torque.knee"], 0.2, atol=1e-6)
    done("import", "source=bag", "mapping=unitree_go2", "name=go2", folder=tmp_path)
    go2 = read(tmp_path / "runs/go2/import/trajectories.parquet")
    order = [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]  # the motor of each joint, legs FL, FR, RL, RR
    first = np.array([0.0, *MEASURED[0], *0.01 * np.arange(3, 13)])
    np.testing.assert_allclose(go2.episodes[0].position[0], first[order], atol=1e-6)
    sent = {"velocity": 0.0, "torque": 0.0, "kp": 20.0, "kd": 1.5}
    for kind, value in sent.items():
        np.testing.assert_allclose(go2.episodes[0].sensors[f"{kind}_command.FL_hip_joint"], value, atol=1e-6)
    signals["action"]["column"] = "motor_cmd[{joint}].Q"
    chosen = mapping(tmp_path, joints={"hip": 1, "knee": 2}, time="time", signals=signals)
    line = refused("import", "source=bag", chosen, folder=tmp_path)
    assert "column motor_cmd[1].Q: is missing, did you mean motor_cmd[1].q?" in line


@pytest.mark.parametrize("ros", [1, 2])
def test_the_first_point_of_a_trajectory_is_a_command_by_joint(tmp_path: Path, ros: int) -> None:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    plan, point = (
        store.types["trajectory_msgs/msg/JointTrajectory"],
        store.types["trajectory_msgs/msg/JointTrajectoryPoint"],
    )
    state, header = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    stamp, duration = store.types["builtin_interfaces/msg/Time"], store.types["builtin_interfaces/msg/Duration"]
    none, names = np.zeros(0), ["knee", "hip"]
    topics: dict[str, list[Any]] = {"/plan": [], "/joint_states": []}
    for row, (goal, q) in enumerate(zip(GOAL, MEASURED, strict=True)):
        at = START + 10_000_000 * row
        head = (*([row] if ros == 1 else []), stamp(at // 10**9, at % 10**9), "")
        points = [point(goal[::-1].copy(), none, none, none, duration(0, 10_000_000))]
        topics["/plan"].append(plan(header(*head), names, points))
        topics["/joint_states"].append(state(header(*head), names, q[::-1].copy(), none, none))
    if ros == 2:
        write_ros2(tmp_path / "bag", store, topics, "MCAP")
    else:
        from rosbags.rosbag1 import Writer

        with Writer(tmp_path / "log.bag") as bag:
            places = {
                t: bag.add_connection(t, messages[0].__msgtype__, typestore=store) for t, messages in topics.items()
            }
            for row in range(len(TIME)):
                for topic, messages in topics.items():
                    raw = store.serialize_ros1(messages[row], messages[row].__msgtype__)
                    bag.write(places[topic], START + 10_000_000 * row, raw)
    signals = {
        "action": {"file": "/plan", "column": "points[0].positions.{joint}"},
        "position": {"file": "/joint_states", "column": "position.{joint}"},
    }
    chosen = mapping(tmp_path, joints=["hip", "knee"], time="header.stamp", signals=signals)
    done("import", f"source={'bag' if ros == 2 else 'log.bag'}", chosen, "name=log", folder=tmp_path)
    batch = read(tmp_path / "runs/log/import/trajectories.parquet")
    np.testing.assert_allclose(batch.episodes[0].position, MEASURED, atol=1e-6)
    np.testing.assert_allclose(batch.episodes[0].action, GOAL[:-1], atol=1e-6)


def test_messages_without_a_definition_are_refused_with_what_to_do(tmp_path: Path) -> None:
    store = ros2_store()
    state, low_state = store.types["unitree_go/msg/MotorState"], store.types["unitree_go/msg/LowState"]
    message = low_state(np.array([254, 239], np.uint8), [state(1, 0.0, 0.1, 0.2, 30)] * 13, 0)
    write_ros2(tmp_path / "bag", store, {"/lowstate": [message] * len(TIME)}, "SQLITE3")
    (file,) = (tmp_path / "bag").glob("*.db3")
    with closing(sqlite3.connect(file)) as bag, bag:
        bag.execute("DELETE FROM message_definitions")
    signals = {name: {"file": "/lowstate", "column": "motor_state[{joint}].q"} for name in ("action", "position")}
    chosen = mapping(tmp_path, joints={"hip": 1, "knee": 2}, time="time", signals=signals)
    line = refused("import", "source=bag", chosen, folder=tmp_path)
    assert "holds messages of unitree_go/msg/LowState without their definition; write it as MCAP" in line


def test_joints_holes_and_ends_of_a_bag_are_told_as_those_of_files(tmp_path: Path) -> None:
    store = ros2_store()
    state, header = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    stamp, none = store.types["builtin_interfaces/msg/Time"], np.zeros(0)
    for name, names, hole in (("renamed", ["hip", "knee_2"], 0), ("hole", ["hip", "knee"], 30)):
        topics: dict[str, list[Any]] = {"/command": [], "/state": []}
        for row, (goal, q) in enumerate(zip(GOAL, MEASURED, strict=True)):
            at = START + 10_000_000 * row + hole * 10**9 * (row > 80)
            for topic, joints, values in (("/command", names, goal), ("/state", ["hip", "knee"], q)):
                head = header(stamp(at // 10**9, at % 10**9), "")
                topics[topic].append(state(head, joints, values.copy(), none, none))
        write_ros2(tmp_path / name, store, topics, "MCAP")
    form = "position.{joint}"
    signals = {"action": {"file": "/command", "column": form}, "position": {"file": "/state", "column": form}}
    chosen = mapping(tmp_path, time="header.stamp", signals=signals)
    line = refused("import", "source=renamed", chosen, folder=tmp_path)
    assert line.startswith(
        "renamed, column /command position.knee_2: goes with /state position.knee_2, which is missing; did you mean "
        "/state position.knee? Pair all: 'mapping.signals.action={column: {knee: position.knee_2, ...}}'"
    )
    said = done("import", "source=hole", chosen, "name=log", folder=tmp_path)
    assert "warning: hole: has no row for 30 s after 0.8 s, and is cut into 2 episodes" in said.err
    file = next((tmp_path / "hole").glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:-500])
    line = refused("import", "source=hole", chosen, folder=tmp_path)
    assert line.endswith(f"if its recorder was killed: mcap recover hole/{file.name} -o whole.mcap")
