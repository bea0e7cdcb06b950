"""Tables as a person sees them: drawn at once, growing on a terminal, or growing line by line in a log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import rich.table

CELL = 13
"""Least width of a column whose later cells are not known yet."""


class LineTable:
    """A table that grows by one aligned line a row; its titles come again when something else was said in between."""

    def __init__(self, title: str, columns: Sequence[str], say: Callable[[str], None]) -> None:
        self._title, self._columns, self._say = title, columns, say
        self._widths = [max(CELL, len(column)) for column in columns]
        self.interrupted = True

    def row(self, *cells: object) -> None:
        """Say one row."""
        if self.interrupted:
            self._say(f"{self._title}\n{self._line(self._columns)}")
        self._say(self._line([str(cell) for cell in cells]))
        self.interrupted = False

    def _line(self, cells: Sequence[str]) -> str:
        self._widths = [max(pair) for pair in zip(self._widths, map(len, cells), strict=True)]
        padded = [cell.ljust(width) for cell, width in zip(cells, self._widths, strict=True)]
        return ("  " + "  ".join(padded)).rstrip()


class RichLiveTable:
    """A table that grows while a person watches, with what is going on as its caption."""

    def __init__(self, table: rich.table.Table, refresh: Callable[[], None]) -> None:
        self._table, self._refresh = table, refresh

    def row(self, *cells: object) -> None:
        """Add one row."""
        from rich.text import Text

        self._table.add_row(*(Text(str(cell)) for cell in cells))
        self._refresh()

    def caption(self, text: str) -> None:
        """Say below the table what is going on."""
        from rich.text import Text

        self._table.caption = Text(text)
        self._refresh()


def drawn(columns: Sequence[str], rows: Sequence[Sequence[object]], title: str | None = None) -> rich.table.Table:
    """Return a table as rich draws it; a column of numbers is aligned to the right, and brackets are only brackets."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    heading = None if title is None else Text(title)
    table = Table(
        title=heading,
        box=box.SIMPLE_HEAD,
        show_header=any(columns),
        title_justify="left",
        caption_justify="left",
    )
    for index, column in enumerate(columns):
        numbers = bool(rows) and all(_is_number(row[index]) for row in rows)
        table.add_column(Text(column), justify="right" if numbers else "left", no_wrap=index == 0, overflow="fold")
    for row in rows:
        table.add_row(*(Text(str(cell)) for cell in row))
    return table


def _is_number(cell: object) -> bool:
    text = str(cell)
    return text in ("", "-") or text.lstrip("+-")[:1].isdigit() and not any(letter in text for letter in ":/=")
