"""The answer of a robot: episodes as rows of one CSV file, measured distances and falls as rows of another.

Either file is replaced whole when an episode is complete, so that there is never half an episode in it.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from gsl.errors import ArtifactError

ANSWER, RETURNS = "answer.csv", "returns.csv"
MARK = "# gsl answer to request "
RETURN_COLUMNS = ("episode", "distance", "fell")
YES = ("true", "yes", "1")


def marked(path: Path) -> str:
    """Return the hash of the request that a file says it answers, nothing if it says none."""
    with path.open(encoding="utf-8", errors="replace") as file:
        first = file.readline(200)
    return first.removeprefix(MARK).strip() if first.startswith(MARK) else ""


def keep(path: Path, request: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Add the rows of a complete episode, in place of an earlier run of it; floats come back as they were, to the bit.

    Raises:
        ArtifactError: The file answers another request, or has other columns.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    before = ""
    if path.exists():
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        if marked(path) != request:
            raise ArtifactError(path, "answers another request; move it away or choose another --log")
        if lines[1].strip() != ",".join(columns):
            raise ArtifactError(path, "has other columns than the robot tells now; choose another --log")
        before = "".join([*lines[:2], *(line for line in lines[2:] if not line.startswith(f"{rows[0][0]},"))])
    else:
        before = f"{MARK}{request}\n{','.join(columns)}\n"
    writer.writerows([_cell(value) for value in row] for row in rows)
    _replace(path, before + text.getvalue())


def ends(path: Path) -> dict[int, bool]:
    """Return for every episode of an answer, by number, whether it ended in a fall or was stopped for safety."""
    found: dict[int, bool] = {}
    if path.exists():
        for row in _rows(path):
            found[int(row["episode"])] = row["fell"] in YES or row["stopped"] in YES
    return found


def returned(path: Path) -> dict[str, Mapping[str, str]]:
    """Return the rows of a file of returns by the name of the episode."""
    return {row["episode"]: row for row in _rows(path)} if path.exists() else {}


def add_return(path: Path, request: str, episode: str, distance: str, *, fell: bool) -> None:
    """Write down what a person measured, in place of what was there."""
    row = {"episode": episode, "distance": distance, "fell": "yes" if fell else "no"}
    rows = {**returned(path), episode: row}
    lines = [",".join(row.get(name) or "" for name in RETURN_COLUMNS) for row in rows.values()]
    _replace(path, "\n".join([f"{MARK}{request}", ",".join(RETURN_COLUMNS), *lines, ""]))


def _rows(path: Path) -> Iterator[Mapping[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        yield from csv.DictReader(line for line in file if not line.startswith("#"))


def _cell(value: object) -> object:
    if isinstance(value, bool):
        return "true" if value else "false"
    return "" if value is None or value != value else value


def _replace(path: Path, text: str) -> None:
    temporary = path.with_name(f".{path.name}.tmp")
    with temporary.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)
