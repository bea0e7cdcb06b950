"""Trajectories as a LeRobot data set, v3.0: joint angles in degrees, as LeRobot's arms have them, no videos.

Joints that slide stay in metres.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.trajectory import Batch, Trajectory
from gsl.export.omissions import REWARD, TIME, VELOCITY, list_omissions

VERSION = "v3.0"
DEGREES = 180.0 / np.pi
_DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_EPISODES = "meta/episodes/chunk-000/file-000.parquet"
_INDICES = ("frame_index", "episode_index", "index", "task_index")


def write_lerobot(folder: Path, batch: Batch, task: str) -> list[str]:
    """Write a data set; return what it cannot hold.

    Args:
        folder: Of the data set.
        batch: Trajectories; the last row of an episode, which has no action, is left out.
        task: In words.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    lengths = [len(episode) for episode in batch.episodes]
    ends = np.cumsum(lengths)
    vectors, features = _vectors(batch)
    columns: dict[str, Any] = {
        name: pa.array(list(values.astype(np.float32)), type=pa.list_(pa.float32(), values.shape[1]))
        for name, values in vectors.items()
    }
    counts = {
        "frame_index": np.concatenate([np.arange(length) for length in lengths]),
        "episode_index": np.repeat(np.arange(len(lengths)), lengths),
        "index": np.arange(ends[-1]),
        "task_index": np.zeros(ends[-1]),
    }
    times = np.concatenate([episode.time[:-1] - episode.time[0] for episode in batch.episodes])
    columns["timestamp"] = pa.array(times.astype(np.float32))
    columns |= {name: pa.array(values.astype(np.int64)) for name, values in counts.items()}
    _write(folder / _DATA.format(chunk_index=0, file_index=0), pa.table(columns), pq)
    fps = 1.0 / batch.control_period
    info = {
        "codebase_version": VERSION,
        "robot_type": str(batch.metadata.get("robot") or "unknown"),
        "total_episodes": len(lengths),
        "total_frames": int(ends[-1]),
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": round(fps) if abs(fps - round(fps)) < 1e-6 else fps,
        "splits": {"train": f"0:{len(lengths)}"},
        "data_path": _DATA,
        "video_path": None,
        "features": features,
        **({} if batch.states else {"angles": "deg"}),  # gsl's own entries: LeRobot has none
        **({"slides": slides} if (slides := _slides(batch)) else {}),
    }
    _write_json(folder / "meta/info.json", info)
    arrays = {**vectors, "timestamp": times[:, None], **{name: counts[name][:, None] for name in _INDICES}}
    _write_json(folder / "meta/stats.json", {name: _statistics(values) for name, values in arrays.items()})
    _write(folder / "meta/tasks.parquet", _tasks(task), pq)
    episodes = {
        "episode_index": np.arange(len(lengths)),
        "tasks": [[task]] * len(lengths),
        "length": lengths,
        "data/chunk_index": [0] * len(lengths),
        "data/file_index": [0] * len(lengths),
        "dataset_from_index": [0, *ends[:-1].tolist()],
        "dataset_to_index": ends.tolist(),
        "meta/episodes/chunk_index": [0] * len(lengths),
        "meta/episodes/file_index": [0] * len(lengths),
    }
    _write(folder / _EPISODES, pa.table(episodes), pq)
    return list_omissions(batch, TIME, VELOCITY, REWARD, "robot", "slides")


def _vectors(batch: Batch) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Return what every frame has, shapes (n_frames, n), and its description."""

    def stack(part: Any) -> np.ndarray:
        return np.concatenate([part(episode)[: len(episode)] for episode in batch.episodes])

    def position(episode: Trajectory) -> np.ndarray:
        return episode.state if episode.state is not None else episode.position

    turn = 1.0 if batch.states else np.where(np.isin(batch.joints, _slides(batch)), 1.0, DEGREES)
    state = [f"state.{k}" for k in range(batch.states)]
    vectors = {"observation.state": turn * stack(position), "action": turn * stack(lambda episode: episode.action)}
    names = {
        "observation.state": state or [f"{joint}.pos" for joint in batch.joints],
        "action": [f"{joint}.pos" for joint in batch.joints] if not state else list(batch.joints),
    }
    if not state:
        vectors["observation.velocity"] = turn * stack(lambda episode: episode.velocity)
        names["observation.velocity"] = [f"{joint}.vel" for joint in batch.joints]
    if all(episode.reward is not None for episode in batch.episodes):
        vectors["next.reward"] = stack(lambda episode: np.asarray(episode.reward)[:, None])
        names["next.reward"] = []
    features = {
        name: {"dtype": "float32", "shape": [values.shape[1]], "names": names[name] or None}
        for name, values in vectors.items()
    }
    features["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    features |= {name: {"dtype": "int64", "shape": [1], "names": None} for name in _INDICES}
    return vectors, features


def _slides(batch: Batch) -> list[str]:
    """Return the joints whose positions are in metres."""
    slides = batch.metadata.get("slides") or []
    return [joint for joint in batch.joints if joint in slides]


def _statistics(values: np.ndarray) -> dict[str, list[float]]:
    return {
        "min": values.min(axis=0).tolist(),
        "max": values.max(axis=0).tolist(),
        "mean": values.mean(axis=0).tolist(),
        "std": values.std(axis=0).tolist(),
        "count": [len(values)],
    }


def _tasks(task: str) -> Any:
    """Return the table of tasks, whose index, as pandas writes it, is the task in words."""
    import pandas as pd
    import pyarrow as pa

    return pa.Table.from_pandas(pd.DataFrame({"task_index": [0]}, index=pd.Index([task], name="task")))


def _write(path: Path, table: Any, pq: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path)


def _write_json(path: Path, value: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value, indent=4) + "\n", encoding="utf-8")
