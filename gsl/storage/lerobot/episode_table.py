"""The frames of one episode as a table: lists by feature, one number a name (`action.shoulder_pan.pos`), and `time`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gsl.core.budget import open_file
from gsl.errors import TrajectoryError
from gsl.storage.importers.parquet_table import convert, names_of
from gsl.storage.importers.sizes import check_need
from gsl.storage.importers.table import missing_column
from gsl.storage.lerobot.dataset import Entry
from gsl.storage.parquet import count_bytes

TIME, STAMP, FRAME = "time", "timestamp", "frame_index"
NEAR = 1e-3  # [s]; stamps are 32-bit numbers, which are off by 0.0001 s an hour into an episode


class EpisodeTable:
    """One episode; `time` is the frame's number over the rate, unless the stamps say otherwise."""

    first_line: int | None = None

    def __init__(self, entry: Entry, memory: float) -> None:
        self.entry, self.path, self.memory = entry, entry.file, memory
        self.fields: Mapping[str, Any] = entry.fields
        self.raw = names_of(self.path)
        self.parts = {
            f"{key}.{name}": (key, index)
            for key, names in entry.names.items()
            if key in self.raw
            for index, name in enumerate(names)
        }
        self.names: Sequence[str] = [TIME, *(name for name in self.raw if name != TIME), *self.parts]

    def columns(self, wanted: Sequence[str]) -> dict[str, np.ndarray]:
        """Return the wanted columns."""
        for name in wanted:
            if name not in self.names:
                raise missing_column(self, name)
        stored = [self.parts[name][0] if name in self.parts else name for name in wanted if name != TIME]
        values = self._read(list(dict.fromkeys([*stored, *([STAMP, FRAME] if TIME in wanted else [])])))
        if TIME in wanted:
            values[TIME] = self._time(values[STAMP], values[FRAME])
        return {name: values[name] if name not in self.parts else self._part(values, name) for name in wanted}

    def _part(self, values: Mapping[str, np.ndarray], name: str) -> np.ndarray:
        key, index = self.parts[name]
        if values[key].ndim != 2 or values[key].shape[1] != len(self.entry.names[key]):
            due = len(self.entry.names[key])
            raise TrajectoryError(self.path, f"has not the {due} values a row that info.json names", column=key)
        return values[key][:, index]

    def _time(self, stamps: np.ndarray, frames: np.ndarray) -> np.ndarray:
        """Return when the frames were taken [s]: by their numbers, whose stamps are rounded to 32 bits."""
        even = frames.astype(np.float64) / float(self.entry.fields["fps"])
        return even if np.abs(even - stamps).max() < NEAR else stamps.astype(np.float64)

    def _read(self, names: list[str]) -> dict[str, np.ndarray]:
        import pyarrow as pa
        import pyarrow.parquet as pq

        for name in (*names, "episode_index"):
            if name not in self.raw:
                raise TrajectoryError(self.path, "is missing; every data set of LeRobot has it", column=name)
        try:
            with open_file(self.path) as source:
                check_need(self.path, 2.0 * count_bytes(pq.read_metadata(source), names), self.memory)
                table = pq.read_table(source, columns=names, filters=[("episode_index", "==", self.entry.number)])
        except (pa.ArrowException, OSError, ValueError) as error:
            raise TrajectoryError(self.path, "is truncated or damaged; copy it again") from error
        if table.num_rows != self.entry.rows:
            problem = f"has {table.num_rows} frames of episode {self.entry.number}, meta says {self.entry.rows}"
            raise TrajectoryError(self.path, f"{problem}; copy the data set again, or record it again")
        return {name: convert(self.path, name, table.column(name)) for name in names}
