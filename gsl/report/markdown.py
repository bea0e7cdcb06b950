"""Tables as markdown."""

from __future__ import annotations

from collections.abc import Sequence


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table, one line a row, with a line end after the last."""
    return "".join(f"| {' | '.join(line)} |\n" for line in (columns, ["---"] * len(columns), *rows))


def read_table(lines: Sequence[str]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return the titles and rows of a table that `table` has written, line by line."""
    titles, _, *rows = (tuple(cell.strip() for cell in line[1:-1].split("|")) for line in lines)
    return titles, rows
