"""Write shipped logs as other programs keep theirs: python examples/formats.py FOLDER [FORMAT ...].

The Go2's chirp is written in each format whose rows are joints, a motion of the SO-101 as data sets of LeRobot.
Every line that this prints is the command that imports what was written.
"""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import yaml

ROOT = Path(__file__).resolve().parents[1]
JOINTS = tuple(yaml.safe_load((ROOT / "conf/mapping/go2_in_air.yaml").read_text())["joints"])
MOTORS = tuple(yaml.safe_load((ROOT / "conf/mapping/unitree_go2.yaml").read_text())["joints"].values())
GAINS = tuple(yaml.safe_load((ROOT / "conf/mapping/go2_in_air.yaml").read_text())["about"].values())  # kp, kd
STEP = 360.0 / 4095.0  # what LeRobot takes an encoder step for [°]
START = 1_700_000_000_000_000_000  # of a bag [ns]


class Log(NamedTuple):
    """Stamps [s], shape (T,), commanded and measured angles [rad], shape (T, n)."""

    time: np.ndarray
    action: np.ndarray
    position: np.ndarray


def read_chirp() -> Log:
    """Return the log of the Go2 as its authors keep it."""
    with np.load(ROOT / "data/real_logs/go2_in_air/traj_0.npz") as file:
        names = ("time", "des_dof_pos", "dof_pos")
        return Log(*(np.ascontiguousarray(file[name], dtype=float) for name in names))


def read_motion() -> Log:
    """Return a motion of the SO-101 as its authors keep it; the last joint is a share of the gripper's range."""
    place = ROOT / "data/real_logs/so101_arm/repeat3_2026-02-03/multisine"
    commanded, measured = (pd.read_csv(place / name) for name in ("control.csv.gz", "state_motor.csv.gz"))
    rows = min(len(commanded), len(measured))
    action, position = (
        np.array(table["positions"].map(json.loads).to_list())[:rows] for table in (commanded, measured)
    )
    return Log(1e-6 * measured["timestamp"].to_numpy()[:rows], action, position)


def npz(folder: Path, log: Log) -> tuple[str, ...]:
    """Write the arrays of numpy."""
    np.savez(folder / "chirp.npz", time=log.time, des_dof_pos=log.action, dof_pos=log.position)
    return (f"source={folder}", "mapping=go2_in_air")


def npy(folder: Path, log: Log) -> tuple[str, ...]:
    """Write an array a file."""
    for name, values in zip(("time", "des_dof_pos", "dof_pos"), log, strict=True):
        np.save(folder / f"{name}.npy", values)
    return (f"source={folder}", "mapping=go2_in_air", "mapping.files=null")


def pace(folder: Path, log: Log) -> tuple[str, ...]:
    """Write the tensors of ETH's PACE."""
    import torch

    names = ("time", "des_dof_pos", "dof_pos")
    torch.save({name: torch.tensor(values) for name, values in zip(names, log, strict=True)}, folder / "chirp.pt")
    return (f"source={folder}", "mapping=pace", f"mapping.joints=[{','.join(JOINTS)}]", "mapping.robot=go2")


def matlab(folder: Path, log: Log) -> tuple[str, ...]:
    """Write the matrices of MATLAB."""
    from scipy.io import savemat

    savemat(folder / "chirp.mat", {"time": log.time, "des_dof_pos": log.action, "dof_pos": log.position})
    return (f"source={folder}", "mapping=go2_in_air", "mapping.files='*.mat'")


def hdf5(folder: Path, log: Log) -> tuple[str, ...]:
    """Write a group an episode, as robomimic does."""
    import h5py

    with h5py.File(folder / "demo.hdf5", "w") as file:
        for name, values in zip(("time", "des_dof_pos", "dof_pos"), log, strict=True):
            file[f"data/demo_0/{name}"] = values
    return (f"source={folder}", "mapping=go2_in_air", "mapping.files='*.hdf5'", "mapping.records='data/demo_*'")


def csv(folder: Path, log: Log) -> tuple[str, ...]:
    """Write a column a joint."""
    table(log).to_csv(folder / "chirp.csv", index=False)
    return (f"source={folder / 'chirp.csv'}", "mapping=plain", "mapping.robot=go2")


def parquet(folder: Path, log: Log) -> tuple[str, ...]:
    """Write a column a joint."""
    table(log).to_parquet(folder / "chirp.parquet")
    return (f"source={folder / 'chirp.parquet'}", "mapping=plain", "mapping.robot=go2")


def json_lines(folder: Path, log: Log) -> tuple[str, ...]:
    """Write a document a row."""
    table(log).to_json(folder / "chirp.jsonl", orient="records", lines=True, double_precision=15)
    return (f"source={folder / 'chirp.jsonl'}", "mapping=plain", "mapping.robot=go2")


def table(log: Log) -> pd.DataFrame:
    """Return a log as the columns of `mapping=plain`."""
    columns = {"time": log.time}
    for index, joint in enumerate(JOINTS):
        columns[f"action.{joint}"], columns[f"position.{joint}"] = log.action[:, index], log.position[:, index]
    return pd.DataFrame(columns)


def unitree(folder: Path, log: Log, storage: str) -> tuple[str, ...]:
    """Write a bag of ROS 2 with Unitree's LowCmd and LowState."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    motion = "uint8 mode\nfloat32 q\nfloat32 dq\n"
    store.register(get_types_from_msg(f"{motion}float32 tau\nfloat32 kp\nfloat32 kd\n", "unitree_go/msg/MotorCmd"))
    store.register(get_types_from_msg(f"{motion}float32 tau_est\n", "unitree_go/msg/MotorState"))
    store.register(get_types_from_msg("unitree_go/MotorCmd[20] motor_cmd\n", "unitree_go/msg/LowCmd"))
    store.register(get_types_from_msg("unitree_go/MotorState[20] motor_state\n", "unitree_go/msg/LowState"))
    speeds = np.gradient(log.position, log.time, axis=0)
    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin[storage]) as bag:
        kinds = {"/lowcmd": "unitree_go/msg/LowCmd", "/lowstate": "unitree_go/msg/LowState"}
        places = {topic: bag.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
        for at, goals, angles, turning in zip(log.time, log.action, log.position, speeds, strict=True):
            motors = {
                "/lowcmd": ("MotorCmd", goals, 0.0 * turning, (0.0, *GAINS)),
                "/lowstate": ("MotorState", angles, turning, (0.0,)),
            }
            for topic, (name, here, speed, rest) in motors.items():
                motor, q, dq = store.types[f"unitree_go/msg/{name}"], np.zeros(20), np.zeros(20)
                q[list(MOTORS)], dq[list(MOTORS)] = here, speed
                message = store.types[kinds[topic]]([motor(1, *pair, *rest) for pair in zip(q, dq, strict=True)])
                bag.write(places[topic], START + round(1e9 * at), store.serialize_cdr(message, kinds[topic]))
    return (f"source={folder / 'bag'}", "mapping=unitree_go2", "~mapping.signals.torque")


def mcap(folder: Path, log: Log) -> tuple[str, ...]:
    """Write a bag as MCAP."""
    return unitree(folder, log, "MCAP")


def rosbag2(folder: Path, log: Log) -> tuple[str, ...]:
    """Write a bag as SQLite."""
    return unitree(folder, log, "SQLITE3")


def rosbag1(folder: Path, log: Log) -> tuple[str, ...]:
    """Write a bag of ROS 1 with JointTrajectory and JointState."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    kinds = {"/command": "trajectory_msgs/msg/JointTrajectory", "/joint_states": "sensor_msgs/msg/JointState"}
    plan, state = (store.types[kind] for kind in kinds.values())
    point, header = store.types["trajectory_msgs/msg/JointTrajectoryPoint"], store.types["std_msgs/msg/Header"]
    stamp, duration = store.types["builtin_interfaces/msg/Time"], store.types["builtin_interfaces/msg/Duration"]
    none, names = np.zeros(0), list(JOINTS)
    with Writer(folder / "chirp.bag") as bag:
        places = {topic: bag.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
        for row, (at, goals, angles) in enumerate(zip(log.time, log.action, log.position, strict=True)):
            moment = START + round(1e9 * at)
            head = header(row, stamp(moment // 10**9, moment % 10**9), "")
            points = [point(goals.copy(), none, none, none, duration(0, 0))]
            messages = {
                "/command": plan(head, names, points),
                "/joint_states": state(head, names, angles.copy(), none, none),
            }
            for topic, message in messages.items():
                bag.write(places[topic], moment, store.serialize_ros1(message, kinds[topic]))
    signals = {
        "action": {"file": "/command", "column": "points[0].positions.{joint}", "unit": "rad"},
        "position": {"file": "/joint_states", "column": "position.{joint}", "unit": "rad"},
    }
    mapping = {"robot": "go2", "joints": names, "time": {"column": "header.stamp"}, "signals": signals}
    (folder / "ros.yaml").write_text(yaml.safe_dump(mapping, sort_keys=False))
    return (f"source={folder / 'chirp.bag'}", f"mapping={folder / 'ros.yaml'}")


def lerobot(folder: Path, log: Log, version: str) -> tuple[str, ...]:
    """Write a data set of LeRobot: angles in its degrees, the gripper as a percentage."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows, scale = len(log.time), np.array([4096 / (2 * np.pi) * STEP] * 5 + [100.0])
    action, state = log.action * scale, log.position * scale
    names = [
        f"{name}.pos" for name in ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
    ]
    columns = {
        "action": pa.array(list(action.astype(np.float32))),
        "observation.state": pa.array(list(state.astype(np.float32))),
        "timestamp": pa.array((np.arange(rows) / 50.0).astype(np.float32)),
        "frame_index": pa.array(np.arange(rows)),
        "episode_index": pa.array(np.zeros(rows, dtype=np.int64)),
    }
    episode: dict[str, Any] = {"episode_index": 0, "tasks": ["multisine"], "length": rows}
    if version.startswith("v3"):
        frames = folder / "data/chunk-000/file-000.parquet"
        episodes = folder / "meta/episodes/chunk-000/file-000.parquet"
        episodes.parent.mkdir(parents=True)
        pq.write_table(pa.Table.from_pylist([{**episode, "data/chunk_index": 0, "data/file_index": 0}]), episodes)
    else:
        frames = folder / "data/chunk-000/episode_000000.parquet"
        (folder / "meta").mkdir()
        (folder / "meta/episodes.jsonl").write_text(json.dumps(episode) + "\n")
    frames.parent.mkdir(parents=True)
    pq.write_table(pa.table(columns), frames)
    feature = {"dtype": "float32", "shape": [6], "names": names}
    about = {
        "codebase_version": version, "robot_type": "so101_follower",
        "total_episodes": 1, "fps": 50, "chunks_size": 1000,
        "features": {"action": feature, "observation.state": feature, "timestamp": {"dtype": "float32", "shape": [1]}},
    }  # fmt: skip
    (folder / "meta/info.json").write_text(json.dumps(about))
    return (f"source={folder}",)


def lerobot_2(folder: Path, log: Log) -> tuple[str, ...]:
    """Write a data set of version 2.1."""
    return lerobot(folder, log, "v2.1")


def lerobot_3(folder: Path, log: Log) -> tuple[str, ...]:
    """Write a data set of version 3."""
    return lerobot(folder, log, "v3.0")


CHIRP = (npz, npy, pace, matlab, hdf5, csv, parquet, json_lines, mcap, rosbag2, rosbag1)
MOTION = (lerobot_2, lerobot_3)
FORMATS: Mapping[str, Callable[[Path, Log], tuple[str, ...]]] = {write.__name__: write for write in (*CHIRP, *MOTION)}


def write(folder: Path, name: str) -> tuple[str, ...]:
    """Write a format into a folder of its name, which must be new, and return the words that import it."""
    log = read_motion() if FORMATS[name] in MOTION else read_chirp()
    (folder / name).mkdir(parents=True)
    try:
        return FORMATS[name](folder / name, log)
    except ModuleNotFoundError:
        (folder / name).rmdir()  # every writer imports its library before it writes
        raise


def main(words: list[str]) -> None:
    """Write the formats that are named, or all; a format whose library is missing is left out, with a line."""
    folder, *names = words or ["formats"]
    missing = False
    for name in names or FORMATS:
        if name not in FORMATS:
            sys.exit(f"there is no format {name}; there is {', '.join(FORMATS)}")
        try:
            print("gsl import", f"name={name}", *map(shlex.quote, write(Path(folder), name)), flush=True)
        except FileExistsError:
            sys.exit(f"{Path(folder, name)} exists; move it, or name another folder")
        except ModuleNotFoundError as error:
            missing = True
            extra = "hdf5" if name == "hdf5" else "ros"
            print(f"{name} is left out: {error.name} is missing, pip install 'gsl[{extra}]'", file=sys.stderr)
    sys.exit(1 if missing else 0)


if __name__ == "__main__":
    main(sys.argv[1:])
