"""A topic of a ROS bag (rosbag2 folder, MCAP, SQLite, or a bag of ROS 1), read by the library `rosbags`."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.budget import within
from gsl.errors import InputError, TrajectoryError
from gsl.storage.importers.sizes import check_need
from gsl.storage.importers.table import numbers

STAMP = "time"
TOPICS = "mapping=ros reads /joint_commands and /joint_states, in a mapping of your own `file` is the topic"
LONG = 3600.0  # of CPU: a bag of hours is no attack, one whose messages unpack to more than the memory is
NANOSECOND = 1e-9


class BagTable:
    """One topic: `time` is when the bag received a message [s]; fields are dotted paths.

    Where a message names its entries, as a JointState does, they are columns by that name: `position.knee`.
    """

    first_line: int | None = None

    def __init__(self, path: Path, topic: str, memory: float) -> None:
        self.path, self.topic, self.memory = path, topic, memory
        with within(f"{path}: reading it", seconds=LONG, growth=memory):
            first = next(self._messages(), None)
        if first is None:
            raise TrajectoryError(path, f"has no message on {topic}; record it again")
        self.fields: Mapping[str, Any] = {}
        self.names: Sequence[str] = [STAMP, *_flat(first[1])]

    def columns(self, wanted: Sequence[str]) -> dict[str, np.ndarray]:
        """Return the wanted fields, a row a message."""
        columns: dict[str, list[Any]] = {name: [] for name in wanted}
        fields = {re.split(r"[.\[]", name, maxsplit=1)[0] for name in wanted}
        with within(f"{self.path}: reading it", seconds=LONG, growth=self.memory):
            for row, (stamp, message) in enumerate(self._messages()):
                values = {**_flat(message, fields=fields), STAMP: stamp}
                for name, column in columns.items():
                    if name not in values:
                        raise TrajectoryError(self.path, f"a message on {self.topic} lacks it", column=name, row=row)
                    column.append(values[name])
                if row % 10_000 == 0:
                    check_need(self.path, 50.0 * row * len(columns), self.memory)
        return {name: numbers(self.path, name, values) for name, values in columns.items()}

    def _messages(self) -> Iterator[tuple[float, Any]]:
        anyreader, store = _library(self.path)
        try:
            with anyreader.AnyReader([self.path], default_typestore=store) as bag:
                chosen = [connection for connection in bag.connections if connection.topic == self.topic]
                if not chosen:
                    there = ", ".join(sorted({connection.topic for connection in bag.connections})) or "none"
                    problem = f"has no topic {self.topic}" if self.topic else f"needs a mapping; {TOPICS}"
                    raise TrajectoryError(self.path, f"{problem}; its topics are {there}")
                for connection in chosen:
                    if connection.msgtype not in bag.typestore.fielddefs:
                        raise TrajectoryError(self.path, _explain_no_definition(connection.msgtype))
                for connection, stamp, raw in bag.messages(connections=chosen):
                    yield stamp * NANOSECOND, bag.deserialize(raw, connection.msgtype)
        except InputError:
            raise
        except Exception as error:  # a damaged bag ends the reader in many ways
            problem = f"cannot be read as a bag: {' '.join(str(error).split())}"
            raise TrajectoryError(self.path, f"{problem}; {_explain_cut(self.path)}") from error


def _explain_no_definition(kind: str) -> str:
    """Return what to say of messages without a definition, which rosbag2 leaves out of SQLite bags of before 2023."""
    return (
        f"holds messages of {kind} without their definition; write it as MCAP where the type is installed "
        "(ros2 bag convert), or export the topic as CSV"
    )


def _explain_cut(path: Path) -> str:
    """Return what to type where a bag was never closed."""
    file = next((file for end in ("mcap", "db3") for file in sorted(path.glob(f"*.{end}"))), path)
    how = {
        ".bag": f"rosbag reindex {file}",
        ".mcap": f"mcap recover {file} -o whole.mcap",
        ".db3": f"sqlite3 {file} .recover | sqlite3 whole.db3",
    }.get(file.suffix, f"ros2 bag reindex {file}")
    return f"copy it again, or if its recorder was killed: {how}"


def _library(path: Path) -> tuple[Any, Any]:
    try:
        from rosbags.highlevel import anyreader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InputError(f"{path}: bags are read with the library rosbags: pip install 'gsl[ros]'") from error
    return anyreader, get_typestore(Stores.ROS2_HUMBLE)


def _flat(message: Any, prefix: str = "", names: Any = None, fields: Collection[str] = ()) -> dict[str, Any]:
    """Return the numbers of a message by dotted path, or of some `fields`; entries by their names if it has those.

    An array of messages, such as a robot's motors or the points of a trajectory, is numbered: motor_state[3].q.
    """
    values: dict[str, Any] = {}
    names = getattr(message, "name", getattr(message, "joint_names", names))
    for field in fields or message.__dataclass_fields__:
        value, path = getattr(message, field, None), f"{prefix}{field}"
        if hasattr(value, "__dataclass_fields__"):
            values |= _flat(value, f"{path}.", names)
        elif isinstance(value, list) and value and hasattr(value[0], "__dataclass_fields__"):
            for index, entry in enumerate(value):
                values |= _flat(entry, f"{path}[{index}].", names)
        elif isinstance(value, np.ndarray):
            named = isinstance(names, list) and len(names) == len(value)
            values |= (
                {f"{path}.{name}": float(number) for name, number in zip(names or (), value, strict=False)}
                if named
                else {}
            )
            values[path] = value.tolist()
        elif isinstance(value, bool | int | float):
            values[path] = value
    stamp = {f"{prefix}sec", f"{prefix}nanosec"}
    if stamp <= values.keys():
        values[prefix.rstrip(".")] = values[f"{prefix}sec"] + NANOSECOND * values[f"{prefix}nanosec"]
    return values
