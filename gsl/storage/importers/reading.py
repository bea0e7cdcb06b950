"""From the files of one place to raw signals: stamped values in the contract's units, before they share a clock."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gsl.errors import ConfigError, TrajectoryError
from gsl.storage.importers.columns import Reference, list_columns, output_names, references, side_by_side
from gsl.storage.importers.formats import table
from gsl.storage.importers.joints import joints_of, leave_out, list_left_out
from gsl.storage.importers.labels import constant, find_label_columns
from gsl.storage.importers.mapping import Mapping as LogMapping
from gsl.storage.importers.places import Place, fields_of
from gsl.storage.importers.signal import AXES, BESIDE, BY_NAME, COMMANDS, FLAGS, NEEDED, Signal
from gsl.storage.importers.sizes import OPEN_END, is_open_line
from gsl.storage.importers.stamps import order_rows, seconds
from gsl.storage.importers.table import Table, missing_column
from gsl.storage.trajectory_contract import UNITS

FILE = "file"
MOST_EPISODES = 10_000  # in one file


class Series(NamedTuple):
    """A signal with its stamps.

    Attributes:
        stamps: Rising [s], shape (T,).
        values: In the contract's unit, shape (T, k).
        names: The contract's columns, k of them.
    """

    stamps: np.ndarray
    values: np.ndarray
    names: tuple[str, ...]


@dataclass(frozen=True)
class Raw:
    """One recorded episode as it is in the files.

    Attributes:
        name: Where it comes from.
        file: Of its positions.
        joints: Names, in order.
        signals: By the contract's name.
        fields: What its files and its path say once.
        dropped: Rows left out because their stamp had come before.
        remarks: On columns that were left out.
    """

    name: str
    file: Path
    joints: tuple[str, ...]
    signals: Mapping[str, Series]
    fields: Mapping[str, Any]
    dropped: int
    remarks: tuple[str, ...] = ()


def raw_episodes(place: Place, mapping: LogMapping, memory: float) -> Iterator[Raw]:
    """Read what the mapping names in the files of a place.

    Raises:
        InputError: A file is missing something, or is empty, damaged or too large.
    """
    tables: dict[str, Table] = {}
    try:
        tables |= _tables(place, mapping, memory)
        yield from _episodes(place, mapping, tables)
    except RecursionError as error:
        raise TrajectoryError(place.name, "is nested too deeply; it is no log") from error
    except TrajectoryError as error:
        raise _in_lines(error, tables.values()) from error


def _in_lines(error: TrajectoryError, tables: Iterable[Table]) -> TrajectoryError:
    """Return an error with the line of its row, as an editor counts, where the file has one row a line."""
    first = next((table.first_line for table in tables if table.path == error.path), None)
    line = error.line if first is None or error.row is None else error.row + first
    if line is None:
        return error
    cut = f"; {OPEN_END}" if is_open_line(error.path, line) else ""
    return TrajectoryError(error.path, f"{error.problem}{cut}", column=error.column, line=line)


def _episodes(place: Place, mapping: LogMapping, tables: Mapping[str, Table]) -> Iterator[Raw]:
    joints = joints_of(mapping, tables)
    mapping.check_joints(list(joints))
    remarks = tuple(list_left_out(mapping, joints, tables))
    named = {name: signal for name, signal in mapping.signals.items() if _there(name, signal, joints, tables)}
    others = {role: list_columns(mapping, joints, role) for role in tables}
    references_of = {
        name: references(name, signal, joints, tables[signal.file], others[signal.file])
        for name, signal in named.items()
    }
    fields = {name: value for table in tables.values() for name, value in table.fields.items()}
    fields |= {FILE: place.name, **fields_of(place.name, mapping.path)}
    label_columns = find_label_columns(mapping, fields, tables)
    values = {
        role: _columns(table, role, mapping, named, references_of, label_columns[role])
        for role, table in tables.items()
    }
    for key, rows in _groups(values, mapping, tables):
        own = {**fields, **({mapping.episode: key} if key is not None else {})}
        for role, own_rows in rows.items():
            cells = {column: values[role][column][own_rows] for column in label_columns[role]}
            own |= {column: constant(tables[role], column, part, own_rows) for column, part in cells.items()}
        name = place.name if key is None else f"{place.name}/{key}"
        signals, dropped = {}, 0
        for signal, spec in named.items():
            reading = _Reading(signal, spec, references_of[signal], tables[spec.file], rows[spec.file], mapping)
            if spec.optional and reading.is_empty(values[spec.file]):
                continue
            series, twice = reading.series(values[spec.file], tuple(joints))
            signals[signal], dropped = series, max(dropped, twice)
        yield Raw(name, tables[named["position"].file].path, tuple(joints), signals, own, dropped, remarks)


def _tables(place: Place, mapping: LogMapping, memory: float) -> dict[str, Table]:
    roles = dict.fromkeys(signal.file for signal in mapping.signals.values())
    return {
        role: table(
            place.files.get(role) or place.files[""],
            topic=role,
            records=mapping.records if place.group is None else place.group,
            memory=memory,
            entry=place.entry,
        )
        for role in roles
    }


def _there(name: str, signal: Signal, joints: Mapping[str, str], tables: Mapping[str, Table]) -> bool:
    if not signal.optional:
        return True
    try:
        return bool(references(name, signal, joints, tables[signal.file]))
    except TrajectoryError:
        return False


def _columns(
    table: Table,
    role: str,
    mapping: LogMapping,
    named: Mapping[str, Signal],
    references_of: Mapping[str, Sequence[Reference]],
    lengths_text: Sequence[str],
) -> dict[str, np.ndarray]:
    """Return all columns that are needed of a file, read once."""
    signals = [name for name, signal in named.items() if signal.file == role]
    wanted = [reference.column for name in signals for reference in references_of[name]]
    if mapping.time.period is None:
        wanted += [named[name].time or mapping.time.column for name in signals]
    if mapping.episode != FILE:
        wanted.append(mapping.episode)
    wanted += lengths_text
    for name in wanted:
        if name not in table.names:
            raise missing_column(table, name)
    values = table.columns(list(dict.fromkeys(wanted)))
    lengths = {name: len(column) for name, column in values.items()}
    if len(set(lengths.values())) > 1:
        lengths_text = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise TrajectoryError(table.path, f"its columns are of different lengths: {lengths_text}")
    if not min(lengths.values()):
        raise TrajectoryError(table.path, "has no rows; log it again")
    return values


def _groups(
    values: Mapping[str, Mapping[str, np.ndarray]], mapping: LogMapping, tables: Mapping[str, Table]
) -> Iterator[tuple[Any, dict[str, np.ndarray]]]:
    """Return for each episode the rows that are its own, by role; all where a file is one episode."""
    if mapping.episode == FILE:
        yield None, {role: np.arange(len(next(iter(columns.values())))) for role, columns in values.items()}
        return
    apart: dict[str, dict[Any, list[int]]] = {role: {} for role in values}
    for role, columns in values.items():
        for row, key in enumerate(columns[mapping.episode].tolist()):
            apart[role].setdefault(key if np.ndim(key) == 0 else str(key), []).append(row)
        if (count := len(apart[role])) > MOST_EPISODES:
            problem = f"tells {count:,} episodes apart, {MOST_EPISODES:,} at most; is it the column of mapping.episode?"
            raise TrajectoryError(tables[role].path, problem, column=mapping.episode)
    for key in next(iter(apart.values())):
        if empty := [role for role, own in apart.items() if key not in own]:
            raise TrajectoryError(tables[empty[0]].path, f"lacks the episode {key}", column=mapping.episode)
        yield key, {role: np.array(own[key]) for role, own in apart.items()}


class _Reading(NamedTuple):
    """One signal of one episode on its way into the contract's units."""

    name: str
    signal: Signal
    references: Sequence[Reference]
    table: Table
    rows: np.ndarray
    mapping: LogMapping

    def series(self, values: Mapping[str, np.ndarray], joints: tuple[str, ...]) -> tuple[Series, int]:
        """Return the signal and the number of rows that were left out."""
        raw = side_by_side(self.name, self.references, values, joints, self.table)[self.rows]
        stamps = seconds(self.table.path, self._stamps(values), self.mapping.time, self._column())
        keep = self._find_rows(raw, joints)
        stamps, raw, rows = stamps[keep], raw[keep], self.rows[keep]
        drop = self.mapping.duplicates == "drop"
        keep = order_rows(self.table.path, stamps, self._column(), rows, drop=drop, unit=self.mapping.time.unit)
        stamps, raw = stamps[keep], raw[keep]
        names = output_names(self.name, raw.shape[1], joints)
        if self.name in FLAGS:
            return Series(stamps, raw != 0.0, tuple(names)), int(np.sum(~keep))
        wanted = UNITS.get(self.name)
        gains, offsets = np.array([self.signal.scale(key, wanted) for key in self._keys(len(names), joints)]).T
        if self.name in (*COMMANDS, *BESIDE):
            stamps = stamps - self.mapping.command_offset
        return Series(stamps, self.signal.apply_sign(raw) * gains + offsets, tuple(names)), int(np.sum(~keep))

    def is_empty(self, values: Mapping[str, np.ndarray]) -> bool:
        """Tell whether no row has a number: a logger that keeps a column for what it cannot measure."""
        own = [values[reference.column][self.rows] for reference in self.references]
        return all(column.dtype.kind == "f" and not np.isfinite(column).any() for column in own)

    def _keys(self, width: int, joints: Sequence[str]) -> Sequence[str]:
        """Return the joint or axis of each column; none of a signal that is one for all joints."""
        if self.name in AXES or width == len(joints):
            return AXES.get(self.name, tuple(joints))
        if apart := [key for key in BY_NAME if isinstance(getattr(self.signal, key), dict)]:
            where = f"mapping.signals.{self.name}.{apart[0]}"
            raise ConfigError(where, "differs by joint, but the signal is one for all of them; give one value")
        return [""] * width

    def _column(self) -> str:
        return self.signal.time or self.mapping.time.column

    def _stamps(self, values: Mapping[str, np.ndarray]) -> np.ndarray:
        if self.mapping.time.period is not None:
            return self.mapping.time.period * np.arange(len(self.rows))
        return values[self._column()][self.rows]

    def _find_rows(self, raw: np.ndarray, joints: Sequence[str]) -> np.ndarray:
        """Return which rows have values; empty cells are refused unless they mean that nothing is new."""
        wrong = ~np.isfinite(raw)
        empty = wrong.any(axis=1)
        if not empty.any():
            return ~empty
        if self.mapping.blanks == "refuse" or np.isinf(raw).any() or empty.all():
            row = int(np.argmax(empty))
            column = self.references[int(np.argmax(wrong[row])) if len(self.references) > 1 else 0].column
            mend = "drop or mend the row, or say mapping.blanks=skip if it means no news"
            if empty.all():
                mend = f"no row has one; leave {self.name} out of the mapping, or say optional: true"
                if not wrong.all():  # what is optional is left out where no joint has it
                    kept = [joint for joint, gone in zip(joints, wrong.all(axis=0), strict=False) if not gone]
                    out = f"leave it out with '~mapping.signals.{self.name}'"
                    mend = f"no row has one of every joint; {leave_out(kept) if self.name in NEEDED else out}"
            problem = f"is not a finite number; {mend}"
            raise TrajectoryError(self.table.path, problem, column=column, row=int(self.rows[row]))
        return ~empty
