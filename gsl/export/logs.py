"""Trajectories as CSV, MCAP, Minari data sets and Rerun recordings."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.trajectory import Batch, Trajectory
from gsl.errors import ConfigError, InputError
from gsl.export.lerobot import write_lerobot
from gsl.export.omissions import FELL, GROUNDED, LAST, REWARD, SENSORS, TIME, VELOCITY, list_omissions
from gsl.storage.trajectory_columns import columns_of

NANOSECONDS = 1e9
MOST_SECONDS = 2**31 - 1  # of a stamp of ROS 2
_ROOT = "MINARI_DATASETS_PATH"
_ALL = (LAST, TIME, VELOCITY, GROUNDED, REWARD, FELL, SENSORS)
PAUSE = 1.0  # between two episodes of a recording that has one clock [s]


def write_csv(folder: Path, batch: Batch, task: str) -> list[str]:
    """Write one file with the columns of docs/reference/files.md; return what it cannot hold."""
    import pandas as pd

    pd.DataFrame(columns_of(folder, batch)).to_csv(folder / "trajectories.csv", index=False)
    return list_omissions(batch, *_ALL)


def write_mcap(folder: Path, batch: Batch, task: str) -> list[str]:
    """Write a ROS 2 bag in MCAP an episode: JointState on /joint_states and /joint_commands."""
    _need_joints(batch)
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise ConfigError("format", f"mcap needs gsl[ros]: pip install 'gsl[ros]' ({error})") from error
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = store.types
    Header, Time, State = (
        kinds[f"{package}/msg/{name}"]
        for package, name in (("std_msgs", "Header"), ("builtin_interfaces", "Time"), ("sensor_msgs", "JointState"))
    )
    if max(float(episode.time[-1]) for episode in batch.episodes) > MOST_SECONDS:
        raise InputError(f"format = mcap: its stamps end at {MOST_SECONDS:,} s; let the log begin at 0 s")
    nothing, names = np.zeros(0), list(batch.joints)

    def message(seconds: float, position: np.ndarray, velocity: np.ndarray) -> tuple[int, Any]:
        stamp = round(seconds * NANOSECONDS)
        header = Header(Time(*divmod(stamp, round(NANOSECONDS))), "")
        state = State(header, names, np.ascontiguousarray(position), np.ascontiguousarray(velocity), nothing)
        return stamp, store.serialize_cdr(state, State.__msgtype__)

    for number, episode in enumerate(batch.episodes):
        with Writer(folder / f"episode_{number:03d}", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
            topics = [
                bag.add_connection(f"/joint_{what}", State.__msgtype__, typestore=store)
                for what in ("states", "commands")
            ]
            for k, seconds in enumerate(episode.time):
                bag.write(topics[0], *message(seconds, episode.position[k], episode.velocity[k]))
                if k < len(episode):
                    bag.write(topics[1], *message(seconds, episode.action[k], nothing))
    return list_omissions(batch, LAST, TIME, VELOCITY)


def write_minari(folder: Path, batch: Batch, task: str) -> list[str]:
    """Write a Minari data set: observations are positions and velocities, or the state."""
    try:
        import minari
        from gymnasium.spaces import Box
        from minari.data_collector.episode_buffer import EpisodeBuffer
    except ImportError as error:
        raise ConfigError("format", f"minari needs gsl[minari]: pip install 'gsl[minari]' ({error})") from error
    buffers = [_buffer(EpisodeBuffer, number, episode) for number, episode in enumerate(batch.episodes)]
    width = buffers[0].observations.shape[1]
    with _minari_root(folder), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it would like to know author and code
        minari.create_dataset_from_buffers(
            dataset_id="gsl/trajectories-v0", buffer=buffers,
            observation_space=Box(-np.inf, np.inf, (width,), dtype=np.float64),
            action_space=Box(-np.inf, np.inf, (len(batch.joints),), dtype=np.float64),
            algorithm_name=task, description=f"joints: {', '.join(batch.joints)}",
        )  # fmt: skip
    return list_omissions(batch, LAST, VELOCITY, REWARD, FELL, "terminated")


def _buffer(kind: Any, number: int, episode: Trajectory) -> Any:
    observations = episode.state if episode.state is not None else np.hstack([episode.position, episode.velocity])
    count = len(episode)
    ended = np.zeros(count, dtype=bool)
    over = episode.sensors.get("terminated")
    ended[-1] = episode.ended_in_a_fall or (over is not None and bool(over[-1]))
    cut = np.zeros(count, dtype=bool)
    cut[-1] = not ended[-1]
    reward = np.zeros(count) if episode.reward is None else np.asarray(episode.reward)[:count]
    return kind(
        id=number,
        observations=observations,
        actions=episode.action,
        rewards=reward,
        terminations=ended,
        truncations=cut,
    )


@contextmanager
def _minari_root(folder: Path) -> Iterator[None]:
    """Have Minari write into a folder of ours."""
    before = os.environ.get(_ROOT)
    os.environ[_ROOT] = str(folder.absolute())
    try:
        yield
    finally:
        os.environ.pop(_ROOT)
        if before is not None:
            os.environ[_ROOT] = before


def write_rerun(folder: Path, batch: Batch, task: str) -> list[str]:
    """Write a Rerun recording: a scalar for every joint's action, position and velocity, episodes one after another."""
    try:
        import rerun
    except ImportError as error:
        raise ConfigError("format", f"rerun needs gsl[rerun]: pip install 'gsl[rerun]' ({error})") from error
    recording = rerun.RecordingStream("gsl")
    recording.save(str(folder / "trajectories.rrd"))
    start = 0.0
    for number, episode in enumerate(batch.episodes):
        times = rerun.TimeColumn("time", duration=start + episode.time)
        for name, values in _series(batch, episode).items():
            column = (
                times
                if len(values) == len(episode.time)
                else rerun.TimeColumn("time", duration=start + episode.time[:-1])
            )
            recording.send_columns(f"episode_{number:03d}/{name}", [column], rerun.Scalars.columns(scalars=values))
        start += float(episode.time[-1]) + PAUSE
    recording.flush()
    recording.disconnect()
    return list_omissions(batch, *_ALL)


def _series(batch: Batch, episode: Trajectory) -> dict[str, np.ndarray]:
    joints = {"action": episode.action, "position": episode.position, "velocity": episode.velocity}
    joints |= {} if episode.grounded_action is None else {"grounded_action": episode.grounded_action}
    series = {
        f"{part}/{joint}": values[:, k]
        for part, values in joints.items()
        for k, joint in enumerate(batch.joints)
        if values.shape[1]
    }
    if episode.state is not None:
        series |= {f"state/{k}": column for k, column in enumerate(episode.state.T)}
    beside = {"reward": episode.reward, "fell": episode.fell, **episode.sensors}
    return series | {name: np.asarray(values, dtype=float) for name, values in beside.items() if values is not None}


def _need_joints(batch: Batch) -> None:
    if batch.states:
        raise ConfigError("format", "is for joints; these trajectories are of an environment's state")


WRITERS: Mapping[str, Callable[[Path, Batch, str], list[str]]] = {
    "csv": write_csv, "lerobot": write_lerobot, "mcap": write_mcap, "minari": write_minari, "rerun": write_rerun,
}  # fmt: skip
"""Writers by format: folder, trajectories and task in words to what the format cannot hold."""
