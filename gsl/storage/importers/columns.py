"""Which columns of a table a signal names, one a joint or an axis, and their values side by side."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gsl.errors import ConfigError, TrajectoryError
from gsl.storage.importers.joints import JOINT
from gsl.storage.importers.mapping import Mapping as LogMapping
from gsl.storage.importers.signal import AXES, PER_JOINT, Signal
from gsl.storage.importers.table import Table, missing_column

_ENTRY = re.compile(r"(.+)\[(\d+)\]")


class Reference(NamedTuple):
    """A column, or one entry of a column that holds several numbers a row."""

    column: str
    entry: int | None = None


def references(
    name: str, signal: Signal, joints: Mapping[str, str], table: Table, others: Collection[str] = ()
) -> list[Reference]:
    """Return the columns of a signal; `others` are named already.

    Raises:
        TrajectoryError: The table lacks one.
        ConfigError: A joint has none, or that of another.
    """
    references = [_reference(word, table) for word in _words(name, signal, joints)]
    if not references:
        raise ConfigError(f"mapping.signals.{name}.column", "names no column")
    twice = [reference for reference in references if references.count(reference) > 1]
    if twice and name in PER_JOINT:
        problem = f"is that of several joints for {name}; every joint has one of its own"
        raise ConfigError(f"mapping.signals.{name}.column", problem, given=_describe(twice[0]))
    for reference in references:
        if reference.column not in table.names:
            raise missing_column(table, reference.column, others)
    return references


def list_columns(mapping: LogMapping, joints: Mapping[str, str], file: str) -> set[str]:
    """Return the columns that the mapping names of a file."""
    own = {name: signal for name, signal in mapping.signals.items() if signal.file == file}
    words = {word for name, signal in own.items() for word in _words(name, signal, joints)}
    return words | {mapping.time.column, mapping.episode} | {signal.time for signal in own.values()}


def _words(name: str, signal: Signal, joints: Mapping[str, str]) -> list[str]:
    column = signal.column
    if isinstance(column, dict):
        keys = AXES.get(name, tuple(joints))
        if lacking := [key for key in keys if key not in column]:
            raise ConfigError(f"mapping.signals.{name}.column", f"has no value for {', '.join(lacking)}")
        return [str(column[key]) for key in keys]
    if isinstance(column, list):
        return [str(cell) for cell in column]
    if JOINT in str(column) or "{index}" in str(column):
        pairs = enumerate(joints.values())
        return [str(column).replace(JOINT, old).replace("{index}", str(index)) for index, old in pairs]
    return [str(column)]


def _reference(word: str, table: Table) -> Reference:
    entry = _ENTRY.fullmatch(word)
    return Reference(word) if word in table.names or not entry else Reference(entry.group(1), int(entry.group(2)))


def _describe(reference: Reference) -> str:
    return reference.column if reference.entry is None else f"{reference.column}[{reference.entry}]"


def side_by_side(
    name: str, references: Sequence[Reference], values: Mapping[str, np.ndarray], joints: Sequence[str], table: Table
) -> np.ndarray:
    """Return a signal's raw values, shape (T, 1), (T, n_axes) or (T, n_joints).

    Raises:
        TrajectoryError: They are no numbers, or not one a joint or an axis.
    """
    parts = [_part(table, reference, values[reference.column]) for reference in references]
    raw = np.hstack(parts)
    due = len(joints) if name in PER_JOINT else len(AXES[name]) if name in AXES else 0
    fits = raw.shape[1] == due if due else raw.shape[1] in (1, len(joints))
    if not fits:
        what = f"{due} {'joints' if name in PER_JOINT else 'axes'}" if due else f"1 or {len(joints)} are due"
        advice = f"{references[0].column}[3]" if len(references) == 1 and raw.shape[1] > 1 else "a column for each"
        how = f"name each by its number from 0, such as {advice}" if "[" in advice else f"name {advice} in the mapping"
        problem = f"{raw.shape[1]} values a row for {name}, but {what}; {how}"
        raise TrajectoryError(table.path, problem, column=references[0].column)
    return raw


def _part(table: Table, reference: Reference, values: np.ndarray) -> np.ndarray:
    if values.dtype.kind not in "buif":
        raise TrajectoryError(table.path, "holds texts, not numbers", column=reference.column)
    rows = values.reshape(len(values), -1).astype(np.float64)
    if reference.entry is None:
        return rows
    if reference.entry >= rows.shape[1]:
        problem = f"has {rows.shape[1]} values a row; [{reference.entry}] counts from 0"
        raise TrajectoryError(table.path, problem, column=reference.column)
    return rows[:, reference.entry : reference.entry + 1]


def output_names(name: str, width: int, joints: Sequence[str]) -> list[str]:
    """Return the contract's columns of a signal."""
    if name in AXES:
        return [f"{name}.{axis}" for axis in AXES[name]]
    if name in PER_JOINT or (width > 1 and width == len(joints)):
        return [f"{name}.{joint}" for joint in joints]
    return [name]
