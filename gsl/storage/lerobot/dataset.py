"""What a LeRobot data set says of itself: its robot, rate, joints and episodes, and in which file each episode is.

Written after the format's pages and readers in huggingface/lerobot: the page lerobot-dataset-v3 and
src/lerobot/datasets. Version 2 keeps one parquet file an episode, version 3 several episodes in a file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from gsl.core.budget import COLUMNS, open_file, parse_json, read_json, read_text
from gsl.errors import InputError, TrajectoryError
from gsl.storage.importers.sizes import check_need
from gsl.storage.parquet import count_bytes

INFO = "meta/info.json"
STATE, ACTION = "observation.state", "action"
VELOCITY = "observation.velocity"  # of gsl's own data sets: LeRobot's arms log none
VERSIONS = ("v2.0", "v2.1", "v3.")
BY_EPISODE = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"  # of version 2
BY_FILE = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"  # of version 3
MOST_EPISODES = 100_000
MOST = 10**9  # of a number that an episode, a chunk or a file has, or of its frames


class Entry(NamedTuple):
    """One episode of a data set.

    Attributes:
        number: That the data set gives it.
        rows: How many frames it has.
        file: Where they are, with those of other episodes or without.
        fields: What is known of it: robot_type, fps, episode_index, task.
        names: Names of the entries of a list, by feature; none where the data set has none.
    """

    number: int
    rows: int
    file: Path
    fields: Mapping[str, Any]
    names: Mapping[str, tuple[str, ...]]

    @property
    def name(self) -> str:
        """What the episode is called."""
        return f"episode_{self.number:06d}"


class DataSet(NamedTuple):
    """A folder with meta/info.json.

    Where it says so, as gsl's do, `angles` is what they are in, deg or percent, and `slides` are joints in metres.
    """

    folder: Path
    version: str
    robot: str
    names: Mapping[str, tuple[str, ...]]
    widths: Mapping[str, int]
    episodes: tuple[Entry, ...]
    angles: str | None = None
    slides: tuple[str, ...] = ()

    @property
    def files(self) -> list[Path]:
        """What is read of it."""
        about = [self.folder / INFO, *_episode_files(self.folder, self.version)]
        return [*about, *dict.fromkeys(episode.file for episode in self.episodes)]


def is_data_set(path: Path) -> bool:
    """Tell whether a folder is a data set of LeRobot."""
    return (path / INFO).is_file()


def find_data_set(path: Path) -> Path | None:
    """Return the data set that a file or folder is a part of, None if it is of none."""
    return next((folder for folder in list(path.absolute().parents)[:4] if is_data_set(folder)), None)


def open_data_set(folder: Path, memory: float) -> DataSet:
    """Return what a data set says of itself; nothing of its frames is read.

    Args:
        folder: That holds meta/info.json.
        memory: That reading may take [bytes].

    Raises:
        InputError: It is of another version, damaged, or lacks a file.
    """
    info = _read_info(folder)
    version = str(info.get("codebase_version", "of no version"))
    if not version.startswith(VERSIONS):
        problem = f"is {version}; 2.0, 2.1 and 3 are read: convert it with LeRobot's own scripts"
        raise TrajectoryError(folder / INFO, problem)
    if info.get("storage_format", "parquet") not in ("parquet", None):
        problem = f"keeps its frames as {info['storage_format']}; the default layout is read"
        raise TrajectoryError(folder / INFO, problem)
    wanted = BY_FILE if version.startswith("v3") else BY_EPISODE
    if info.get("data_path", wanted) != wanted:
        raise TrajectoryError(folder / INFO, f"data_path is {str(info['data_path'])[:80]}; {wanted} is read")
    names, widths = _read_features(folder, info)
    fps = info.get("fps")
    if not isinstance(fps, int | float) or isinstance(fps, bool) or not 0 < fps < 1e5:
        raise TrajectoryError(folder / INFO, f"fps is {fps!s:.20}, no rate of frames [1/s]")
    robot = str(info.get("robot_type") or "unknown")
    about = {"robot_type": robot, "fps": fps, "data_set": folder.resolve().name}
    chunk = info.get("chunks_size", 1000)
    if type(chunk) is not int or not 0 < chunk < MOST:
        raise TrajectoryError(folder / INFO, f"chunks_size is {chunk!s:.20}, no number of episodes")
    rows = list(islice(_read_episodes(folder, version, memory), MOST_EPISODES + 1))
    if len(rows) > MOST_EPISODES:
        raise TrajectoryError(folder, f"has more than {MOST_EPISODES:,} episodes; take apart what you want to read")
    if not rows:
        raise TrajectoryError(folder, "has no episode; was the recording finished (dataset.finalize())?")
    entries = []
    for row in sorted(rows, key=lambda row: row["episode_index"]):
        index = row["episode_index"]
        if version.startswith("v3"):
            place = BY_FILE.format(chunk_index=row["data/chunk_index"], file_index=row["data/file_index"])
        else:
            place = BY_EPISODE.format(episode_chunk=index // chunk, episode_index=index)
        tasks = row.get("tasks")
        task = {"task": "; ".join(map(str, tasks))} if isinstance(tasks, list) and tasks else {}
        entries.append(Entry(index, row["length"], folder / place, {**about, "episode_index": index, **task}, names))
    _check_files(folder, entries)
    angles = "deg" if info.get("angles") == "deg" else None
    slides = info.get("slides")
    metres = tuple(map(str, slides)) if isinstance(slides, list) else ()
    return DataSet(folder, version, robot, names, widths, tuple(entries), angles, metres)


def _read_info(folder: Path) -> dict[str, Any]:
    try:
        info = read_json(folder / INFO)
    except (OSError, ValueError) as error:
        raise TrajectoryError(folder / INFO, f"cannot be read: {error}; copy the data set again") from error
    if not isinstance(info, dict) or not isinstance(info.get("features"), dict):
        raise TrajectoryError(folder / INFO, "has no features; it is not the meta/info.json of a LeRobot data set")
    return info


def _read_features(folder: Path, info: dict[str, Any]) -> tuple[dict[str, tuple[str, ...]], dict[str, int]]:
    """Return the names of a list's entries and its length, by feature."""
    names, widths = {}, {}
    for key, about in info["features"].items():
        shape = about.get("shape") if isinstance(about, dict) else None
        if not (isinstance(shape, list) and len(shape) == 1 and isinstance(shape[0], int) and shape[0] <= COLUMNS):
            continue
        widths[key], flat = shape[0], tuple(_flatten(about.get("names")))
        if len(flat) == shape[0] and len(set(flat)) == len(flat):
            names[key] = flat
    for key in (STATE, ACTION):
        if key not in widths:
            problem = f"has no feature {key} that is a list of numbers; no import without it"
            raise TrajectoryError(folder / INFO, problem)
    return names, widths


def _flatten(names: Any) -> Iterator[str]:
    """Return names of axes: a list, or lists under keys such as `motors`."""
    if isinstance(names, str):
        yield names
    for name in names.values() if isinstance(names, dict) else names if isinstance(names, list) else ():
        yield from _flatten(name)


def _episode_files(folder: Path, version: str) -> list[Path]:
    if version.startswith("v3"):
        return sorted((folder / "meta/episodes").glob("chunk-*/file-*.parquet"))
    return [folder / "meta/episodes.jsonl"]


def _read_episodes(folder: Path, version: str, memory: float) -> Iterator[dict[str, Any]]:
    """Return what is said of each episode."""
    due = ["episode_index", "length"]
    if version.startswith("v3"):
        due += ["data/chunk_index", "data/file_index"]
    for path in _episode_files(folder, version):
        try:
            rows = _read_table(path, [*due, "tasks"], memory) if version.startswith("v3") else _read_lines(path, memory)
        except (OSError, ValueError, NotImplementedError) as error:
            raise TrajectoryError(path, f"cannot be read: {error}; copy the data set again") from error
        for row, cell in enumerate(rows):
            whole = isinstance(cell, dict) and all(type(cell.get(key)) is int and 0 <= cell[key] < MOST for key in due)
            if not whole:
                raise TrajectoryError(path, f"has no whole number for each of {', '.join(due)}", row=row)
            yield cell


def _read_table(path: Path, names: list[str], memory: float) -> list[dict[str, Any]]:
    import pyarrow.parquet as pq

    with open_file(path) as source, pq.ParquetFile(source) as file:
        there = [name for name in names if name in file.schema_arrow.names]
        check_need(path, 20.0 * count_bytes(file.metadata, there), memory)
        return file.read(columns=there).to_pylist()


def _read_lines(path: Path, memory: float) -> list[Any]:
    return [parse_json(line) for line in read_text(path, memory / 10.0).splitlines() if line.strip()]


def _check_files(folder: Path, entries: list[Entry]) -> None:
    lacking = [entry for entry in entries if not entry.file.is_file()]
    if lacking:
        name = lacking[0].file.relative_to(folder)
        problem = (
            f"{len(lacking)} of {len(entries)} episodes have no file here ({name}); download the folder `data` too"
        )
        raise InputError(f"{folder}: {problem}")
