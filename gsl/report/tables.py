"""Tables as a person sees them: drawn at once, growing on a terminal, or growing line by line in a log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

from gsl.core.visible import visible

if TYPE_CHECKING:
    import rich.table

CELL = 13
"""Least width of a column whose later cells are not known yet."""
WORD = 16
"""Longest word that is kept whole."""
EDGE, APART = 1, 3
"""Characters that a drawn table takes besides its cells: in all, and for each column."""


class Table(NamedTuple):
    """A table with its title and what stands below it: the arguments of the console's `table`."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str | None = None


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


class GrowingTable:
    """A table that grows while a person watches."""

    def __init__(self, title: str, columns: Sequence[str]) -> None:
        self._title, self._columns = title, columns
        self._rows: list[Sequence[object]] = []

    def row(self, *cells: object) -> None:
        """Add one row."""
        self._rows.append([visible(str(cell)) for cell in cells])

    def draw(self, width: int) -> rich.table.Table:
        """Return it with the columns that there is room for."""
        rows = [*self._rows]
        return draw_table(self._columns, rows, fitting(self._columns, rows, width), self._title)


def draw_table(
    columns: Sequence[str],
    rows: Sequence[Sequence[object]],
    widths: Sequence[int],
    title: str | None = None,
) -> rich.table.Table:
    """Return a table as rich draws it, of as many columns as `widths`.

    A column of numbers is aligned to the right, and brackets are only brackets.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=None if title is None else Text(title),
        box=box.SIMPLE_HEAD,
        show_header=any(columns),
        title_justify="left",
    )
    for index, (column, width) in enumerate(zip(columns, widths, strict=False)):
        numbers = bool(rows) and all(_is_number(row[index]) for row in rows)
        aligned: Literal["right", "left"] = "right" if numbers else "left"
        table.add_column(Text(column), justify=aligned, overflow="fold", width=width)
    for row in rows:
        table.add_row(*(Text(str(cell)) for cell in row[: len(widths)]))
    return table


def fitting(
    columns: Sequence[str], rows: Sequence[Sequence[object]], width: int, *, leave_out: bool = True
) -> list[int]:
    """Return the widths of the columns that a place of so many characters has room for, from the first, one at least.

    Words stay whole but for those that are longer than `WORD`, such as paths. What stands in the first column stays
    whole as well, if there is room for all columns nevertheless; columns are left out last, or not at all.
    """
    from rich.cells import cell_len

    cells = [[str(row[index]) for row in [columns, *rows]] for index in range(len(columns))]
    widths = [max(map(cell_len, column)) for column in cells]
    words = [max(cell_len(word) for cell in column for word in cell.split() or [""]) for column in cells]
    least = [*widths[:1], *(min(word, WORD) for word in words[1:])]
    if total(least) > width:
        least[:1] = [min(wide, max(WORD, width // 3)) for wide in widths[:1]]
    while leave_out and len(least) > 1 and total(least) > width:
        least.pop()
    widths = widths[: len(least)]
    while total(widths) > width and (foldable := [k for k, few in enumerate(least) if widths[k] > few]):
        widths[max(foldable, key=widths.__getitem__)] -= 1
    return widths


def total(widths: Sequence[int]) -> int:
    """Return how wide a table with such columns is drawn."""
    return EDGE + sum(widths) + APART * len(widths)


def _is_number(cell: object) -> bool:
    text = str(cell)
    return text in ("", "-") or text.lstrip("+-")[:1].isdigit() and not any(letter in text for letter in ":/=")
