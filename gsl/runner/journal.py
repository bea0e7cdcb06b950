"""The answer of a robot: episodes as rows of one CSV file, measured distances and falls as rows of another.

Either file is replaced whole when an episode is complete, so that there is never half an episode in it.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from gsl.core.budget import ARTIFACT_BYTES, DOCUMENT_BYTES, open_file
from gsl.errors import ArtifactError

ANSWER, RETURNS = "answer.csv", "returns.csv"
MARK = "# gsl answer to request "
RETURN_COLUMNS = ("episode", "distance", "fell")
YES = ("true", "yes", "1")


def read_mark(path: Path) -> str:
    """Return the hash of the request that a file says it answers, nothing if it says none.

    Raises:
        InputError: It is no plain file, or too large.
    """
    with open_file(path, ARTIFACT_BYTES) as file:
        first = file.readline(200).decode("utf-8-sig", errors="replace")
    return first.removeprefix(MARK).strip() if first.startswith(MARK) else ""


def check_mark(path: Path, request: str, *, by_hand: bool = False) -> None:
    """Refuse a file, if there is one, that answers another request; one written `by_hand` need not say which.

    Raises:
        ArtifactError: It does.
    """
    if path.exists() and (read_mark(path) or ("" if not by_hand else request)) != request:
        raise ArtifactError(path, "answers another request; move it away or choose another --log")


def is_yes(text: str | None) -> bool:
    """Tell whether a cell of a table says yes."""
    return (text or "").strip().lower() in YES


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
        check_mark(path, request)
        if lines[1].strip() != ",".join(columns):
            raise ArtifactError(path, "has other columns than the robot tells now; choose another --log")
        before = "".join(_without(lines, rows[0][0]))
    else:
        before = f"{MARK}{request}\n{','.join(columns)}\n"
    writer.writerows([_cell(value) for value in row] for row in rows)
    replace(path, before + text.getvalue())


def drop(path: Path, episode: int) -> None:
    """Take out the rows of an episode, by number, if there are any."""
    if not path.exists():
        return
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    left = _without(lines, episode)
    if len(left) == 2:
        path.unlink()  # an answer without an episode is none
    elif len(left) < len(lines):
        replace(path, "".join(left))


def ends(path: Path) -> dict[int, bool]:
    """Return for every episode of an answer, by number, whether it ended in a fall or was stopped for safety."""
    endings: dict[int, bool] = {}
    if path.exists():
        for row in table(path)[1]:
            endings[int(row["episode"])] = is_yes(row["fell"]) or is_yes(row["stopped"])
    return endings


def table(path: Path) -> tuple[list[str], list[dict[str, str]]]:
    """Return the columns of a CSV file and its rows, whoever has written it; lines that begin with # are no rows.

    Raises:
        InputError: It is no plain file, too large, or no table.
    """
    with io.TextIOWrapper(open_file(path, DOCUMENT_BYTES), "utf-8-sig", errors="replace", newline="") as file:
        read = csv.DictReader((line for line in file if not line.startswith("#")), restkey="", restval="")
        try:
            columns = [name.strip() for name in read.fieldnames or ()]
            rows = [dict(zip(columns, row.values(), strict=False)) for row in read]
        except csv.Error as error:
            raise ArtifactError(path, f"is no table: {error}; move it away, or mend it") from error
    return columns, rows


def read_returns(path: Path) -> dict[str, dict[str, str]]:
    """Return the rows of a file of returns by the name of the episode.

    Raises:
        ArtifactError: It does not name the episodes.
    """
    columns, rows = table(path) if path.exists() else (["episode"], [])
    if "episode" not in columns:
        raise ArtifactError(path, f"needs the columns {', '.join(RETURN_COLUMNS)}; it has {', '.join(columns)[:80]}")
    return {row["episode"].strip(): row for row in rows}


def add_return(path: Path, request: str, episode: str, distance: str, *, fell: bool) -> None:
    """Write down what a person measured, in place of what was there of this episode; all else stays.

    Raises:
        ArtifactError: The file answers another request.
    """
    check_mark(path, request, by_hand=True)
    mark = not path.exists() or bool(read_mark(path))
    rows = read_returns(path)
    rows[episode] = {"episode": episode, "distance": distance, "fell": "yes" if fell else "no"}
    columns = list(dict.fromkeys([*(table(path)[0] if path.exists() else ()), *RETURN_COLUMNS]))
    _write_returns(path, request if mark else "", columns, rows.values())


def forget(path: Path, episode: str) -> None:
    """Take out what a person measured in an earlier run of an episode; all else stays."""
    rows = read_returns(path)
    if episode not in rows:
        return
    first, columns = read_mark(path), table(path)[0]
    _write_returns(path, first, columns, [row for name, row in rows.items() if name != episode])


def _without(lines: Sequence[str], episode: object) -> list[str]:
    """Return the lines of an answer but for the rows of an episode."""
    return [*lines[:2], *(line for line in lines[2:] if not line.startswith(f"{episode},"))]


def _write_returns(path: Path, request: str, columns: Sequence[str], rows: Iterable[Mapping[str, str]]) -> None:
    """Write a file of returns, marked with the request that it answers if one is given."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    replace(path, f"{MARK}{request}\n" * bool(request) + text.getvalue())


def _cell(value: object) -> object:
    if isinstance(value, bool):
        return "true" if value else "false"
    return "" if value is None or value != value else value


def replace(path: Path, text: str) -> None:
    """Put a text in place of a file as a whole."""
    temporary = path.with_name(f".{path.name}.tmp")
    with temporary.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)
