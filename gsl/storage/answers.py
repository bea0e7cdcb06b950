"""Answers to a request: what a robot logged, and what a person measured, checked against what was asked for."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.budget import COLUMNS, find_repeat, open_file
from gsl.core.layout import Layout
from gsl.core.trajectory import Trajectory
from gsl.core.validation import did_you_mean
from gsl.errors import ArtifactError, TrajectoryError
from gsl.runner.journal import YES, read_mark, table
from gsl.runner.request import layout_of
from gsl.runner.senses import BODY, JOINTS
from gsl.storage import trajectories
from gsl.storage.trajectory_columns import batch_of
from gsl.storage.trajectory_contract import SCHEMA_VERSION, UNITS, check_names, check_rows

NO = ("false", "no", "0", "")
STOPPED = "stopped"
OFF = 0.5  # of the control period, the most by which a row may come too late or too soon
HUGE = 1e6  # in SI units, more than any of a robot's sensors measures
ROW = 64 * 32  # bytes that no row of ours reaches for a robot of 100 columns
_PATTERNS = ("answer*.csv", "answer*.parquet", "returns*.csv")


@dataclass(frozen=True)
class Answered:
    """What is known of one episode.

    Attributes:
        path: Where it is from.
        trajectory: Its log, if there is one.
        fell: Whether it ended in a fall.
        stopped: Whether the runner stopped it for safety; it counts as a fall.
        distance: Walked forward [m], if somebody measured it.
        value: Of the task, if somebody measured it.
    """

    path: Path
    trajectory: Trajectory | None = None
    fell: bool = False
    stopped: bool = False
    distance: float | None = None
    value: float | None = None


def answer_files(folder: Path) -> list[Path]:
    """Return the files of an answer: in a request's folder, or in a folder of its own in it."""
    matches = (path for pattern in _PATTERNS for start in ("", "*/") for path in folder.glob(start + pattern))
    return sorted(path for path in matches if not path.relative_to(folder).parts[0].startswith("."))


def read_answers(folder: Path, request: Mapping[str, Any]) -> dict[str, Answered]:
    """Return what is known of each episode of a request by name; of those that nobody has run there is nothing.

    Raises:
        ArtifactError: A file answers another request, an episode twice, or not what was asked for.
        TrajectoryError: A log breaks the contract.
    """
    by_log: dict[str, Answered] = {}
    files = answer_files(folder)
    for path in (path for path in files if not path.name.startswith("returns")):
        for name, answer in read_log(path, request).items():
            _once(by_log.get(name), path, name)
            by_log[name] = answer
    by_return: dict[str, Answered] = {}
    for path in (path for path in files if path.name.startswith("returns")):
        for name, answer in read_returns(path, request).items():
            _once(by_return.get(name), path, name)
            by_return[name] = answer
    merged = {name: _merge(by_log.get(name), by_return.get(name)) for name in {**by_log, **by_return}}
    check_lengths(folder, request, merged, set())
    return merged


def read_log(path: Path, request: Mapping[str, Any]) -> dict[str, Answered]:
    """Return the logged episodes of one file that says which request it answers."""
    if path.suffix == ".parquet":
        batch = trajectories.read(path, joints=tuple(request["joints"]))
        check_mark(path, str(batch.metadata.get("request", "")), request)
        labels = [str(entry.get("name", "")) for entry in batch.metadata.get("episodes", [])]
        episodes = read_named(path, labels, batch.episodes, request)
    else:
        check_mark(path, read_mark(path), request)
        episodes = dict(csv_episodes(path, request))
    return {name: _read_log(path, name, episode, request) for name, episode in episodes.items()}


def read_named(
    path: Path, names: Sequence[str], episodes: Sequence[Trajectory], request: Mapping[str, Any]
) -> dict[str, Trajectory]:
    """Return the episodes of a file by their names: as many as there are, of the request, none of them twice."""
    for name in names:
        _match(path, name, request)
        if names.count(name) > 1:
            raise ArtifactError(path, f"{name} is named twice; every episode is one of its own")
    if len(episodes) != len(names):
        problem = f"holds {len(episodes)} episodes, but {len(names)} are named"
        raise ArtifactError(path, f"{problem}; say which they are, in order: episodes=[{', '.join(names[:1])},...]")
    return dict(zip(names, episodes, strict=True))


def check_mark(path: Path, mark: str, request: Mapping[str, Any]) -> None:
    """Refuse what answers another request, or does not say which."""
    if not mark:
        advice = f"gsl answer request={path.parent.as_posix()} logs=... takes in what something else has logged"
        raise ArtifactError(path, f"does not say which request it answers; {advice}")
    if mark != request["hash"]:
        raise ArtifactError(path, f"answers another request ({mark[:12]}, not {request['hash'][:12]}); move it away")


def csv_episodes(path: Path, request: Mapping[str, Any]) -> Iterator[tuple[str, Trajectory]]:
    """Yield the episodes of a CSV file with the columns of the contract, by name; `episode` counts those asked for."""
    columns = _without_gaps(_csv_columns(path, request), request)
    names = [episode["name"] for episode in request["episodes"]]
    units = {**UNITS, STOPPED: "1"}
    metadata = {"schema_version": SCHEMA_VERSION, "units": units, "role": "real", "joints": request["joints"]}
    metadata |= {"robot": request["robot"], "control_period": request["control_period"]}
    check_names(path, list(columns), metadata)
    order = np.argsort(columns["episode"], kind="stable")  # they were run in any order
    columns = {name: values[order] for name, values in columns.items()}
    bounds = check_rows(path, columns)
    for row in bounds[:-1]:
        if not 0 <= (number := int(columns["episode"][row])) < len(names):
            problem = f"there are {len(names)} episodes in the request, counted from 0, not {number}"
            raise TrajectoryError(path, problem, column="episode")
    batch = batch_of(columns, metadata, bounds)
    yield from zip((names[int(columns["episode"][row])] for row in bounds[:-1]), batch.episodes, strict=True)


def read_returns(path: Path, request: Mapping[str, Any]) -> dict[str, Answered]:
    """Return what a person measured: rows of `episode`, `distance` [m] or `value`, and `fell` (yes or no)."""
    if mark := read_mark(path):
        check_mark(path, mark, request)
    answers: dict[str, Answered] = {}
    names, rows = table(path)
    if not {"episode", "fell"} <= set(names) or not {"distance", "value"} & set(names):
        needed = "needs the columns episode, distance (or value) and fell"
        raise ArtifactError(path, f"{needed}; it has {', '.join(names)[:80] or 'none'}")
    for number, row in enumerate(rows, start=1):
        name = _match(path, row["episode"].strip(), request)
        _once(answers.get(name), path, name)
        answers[name] = _read_measured(path, number, row)
    return answers


def _read_measured(path: Path, number: int, row: Mapping[str, Any]) -> Answered:
    fell = str(row.get("fell") or "").strip().lower()
    if fell not in (*YES, *NO):
        raise ArtifactError(path, f"row {number}: fell is '{fell}'; write yes or no")
    numbers = {}
    for name in ("distance", "value"):
        text = str(row.get(name) or "").strip()
        try:
            numbers[name] = float(text) if text else None
        except ValueError as error:
            raise ArtifactError(path, f"row {number}: {name} is '{text}', not a number") from error
        if not abs(numbers[name] or 0.0) <= HUGE:  # not that either
            raise ArtifactError(path, f"row {number}: {name} is '{text[:20]}', which nothing measures")
    if abs(numbers["distance"] or 0.0) > 100.0:
        raise ArtifactError(path, f"row {number}: a distance of {numbers['distance']:g} m; is it in metres?")
    return Answered(path, fell=fell in YES, distance=numbers["distance"], value=numbers["value"])


def _merge(log: Answered | None, returned: Answered | None) -> Answered:
    """Return what log and measurement say together: who says that it fell is right."""
    if log is None or returned is None:
        merged = log or returned
        assert merged is not None
        return merged
    return replace(log, fell=log.fell or returned.fell, distance=returned.distance, value=returned.value)


def check_rate(path: Path, name: str, episode: Trajectory, request: Mapping[str, Any]) -> None:
    """Refuse an episode whose rows are not a control period apart: a policy that acts too late is another policy."""
    period, apart = request["control_period"], np.diff(episode.time)
    wrong = np.abs(apart - period) > OFF * period
    if wrong.any():
        row = int(np.argmax(wrong)) + 1
        gap = f"row {row} comes {1e3 * apart[row - 1]:.3g} ms after the one before, not {1e3 * period:g} ms"
        raise TrajectoryError(path, f"{name}: {gap}; run it again at the rate that was asked for")


def _read_log(path: Path, name: str, episode: Trajectory, request: Mapping[str, Any]) -> Answered:
    check_rate(path, name, episode, request)
    sensors = dict(episode.sensors)
    stopped = bool(sensors.pop(STOPPED, np.zeros(1, dtype=bool))[-1])
    missing = [name for part in _parts(request) for name in part if name not in sensors]
    if missing:
        raise TrajectoryError(path, "is missing, but was asked for", column=missing[0])
    grounded = episode.grounded_action
    if grounded is not None and np.array_equal(grounded, episode.action):
        grounded = None
    whole = replace(episode, sensors=sensors, grounded_action=grounded)
    fell = episode.fell is not None and bool(episode.fell.any())
    return Answered(path, whole, fell=fell, stopped=stopped)


def _parts(request: Mapping[str, Any]) -> list[tuple[str, ...]]:
    layout: Layout = layout_of(request)
    return list(layout.columns.values())


def check_lengths(
    path: Path, request: Mapping[str, Any], answers: Mapping[str, Answered], fallen: Collection[str]
) -> None:
    """Refuse a log that is longer than what was asked for, or shorter without a fall.

    Args:
        path: Where the logs are from, as a person knows them.
        request: What was asked for.
        answers: The episodes by name.
        fallen: Names of those that are known elsewhere to have ended in a fall.
    """
    for episode in request["episodes"]:
        name, steps = episode["name"], episode["steps"]
        answer = answers.get(name)
        if answer is None or answer.trajectory is None:
            continue
        if (length := len(answer.trajectory)) > steps:
            raise ArtifactError(path, f"{name}: has {length} steps, but {steps} were asked for; cut the rest off")
        if length < steps and not (answer.fell or answer.stopped or name in fallen):
            problem = f"{name}: has {length} of {steps} steps and no fall; run it again, or say that it fell"
            raise ArtifactError(path, problem)


def _match(path: Path, name: str, request: Mapping[str, Any]) -> str:
    names = [episode["name"] for episode in request["episodes"]]
    if name not in names:
        raise ArtifactError(path, f"the request has no episode '{name}'{did_you_mean(name, names)}")
    return name


def _once(before: Answered | None, path: Path, name: str) -> None:
    if before is not None:
        raise ArtifactError(path, f"{name} is answered twice, also in {before.path}; take one away")


def _csv_columns(path: Path, request: Mapping[str, Any]) -> dict[str, np.ndarray]:
    import pyarrow as pa
    import pyarrow.csv as pc

    most = ROW * sum(episode["steps"] + 2 for episode in request["episodes"])
    if path.stat().st_size > most:
        size, needed = (f"{count / 1e6:,.0f} MB" for count in (path.stat().st_size, most))
        raise ArtifactError(path, f"is {size}, but what was asked for needs less than {needed}; is it the right file?")
    try:
        with open_file(path) as file:
            above = sum(1 for _ in itertools.takewhile(lambda line: line.startswith((b"#", b"\xef\xbb\xbf#")), file))
            file.seek(0)
            table = pc.read_csv(file, read_options=pc.ReadOptions(skip_rows=above))
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise TrajectoryError(path, f"is no CSV file with a row of names: {' '.join(str(error).split())}") from error
    if len(table.column_names) > COLUMNS:
        raise TrajectoryError(path, f"has {len(table.column_names):,} columns; {COLUMNS:,} are read")
    if (twice := find_repeat(table.column_names)) is not None:
        raise TrajectoryError(path, "there are several columns of this name; keep one", column=twice)
    if not table.num_rows:
        raise TrajectoryError(path, "has no rows; nothing was logged")
    return {name: _values(path, name, table.column(name)) for name in table.column_names}


def _without_gaps(columns: dict[str, np.ndarray], request: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Leave out what nobody asked for and the robot did not tell at every step, unless it is of the base."""
    asked = {name for part in _parts(request) for name in part}
    more = {f"{name}.{joint}" for name in JOINTS for joint in request["joints"]}
    more |= {
        name
        for part, size in BODY.items()
        if not part.startswith("base.")
        for name in Layout((), {part: size}, 1.0).columns[part]
    }
    gaps = {name for name in more - asked if name in columns and columns[name].dtype.kind == "f"}
    return {name: column for name, column in columns.items() if name not in gaps or not np.isnan(column).any()}


def _values(path: Path, name: str, column: Any) -> np.ndarray:
    import pyarrow as pa

    kind = column.type
    if name in ("episode", "step"):
        if not pa.types.is_integer(kind) or column.null_count:
            raise TrajectoryError(path, "must be whole numbers", column=name)
        return np.asarray(column.to_numpy())
    if name in ("fell", STOPPED, "enabled"):
        if not pa.types.is_boolean(kind) or column.null_count:
            raise TrajectoryError(path, "must be true or false", column=name)
        return np.asarray(column.to_numpy())
    if pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
        raise TrajectoryError(path, "holds what is not a number", column=name)
    return np.asarray(column.cast(pa.float64()).to_numpy())
