"""The console is the only place that prints: people read progress on stderr, results go to stdout."""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from gsl.core.console import LiveTable, Progress
from gsl.core.interruption import checkpoint
from gsl.core.visible import visible
from gsl.core.words import duration
from gsl.report.tables import LineTable, RichLiveTable, draw_table, fitting, total

if TYPE_CHECKING:
    import rich.console

_log = logging.getLogger("gsl")

SECONDS_BETWEEN_LINES = 10.0
WIDTH_WITHOUT_TERMINAL = 200


@contextmanager
def divert_prints(active: bool) -> Iterator[None]:
    """Within, what others print on stdout goes to stderr: environments, C libraries and worker processes too."""
    if not active:
        yield
        return
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


class Console:
    """Prints for a person, or exactly one JSON document on stdout.

    Attributes:
        quiet: Whether all consoles leave out what is no result, warning or error.
    """

    quiet: ClassVar[bool] = False

    def __init__(self, *, json: bool = False) -> None:
        self.json = json
        self._live: RichLiveTable | None = None
        self._lines: LineTable | None = None
        self._part = ""

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Within, tables belong to a part of the work that has this name: progress, not results."""
        before, self._part = self._part, name
        try:
            yield
        finally:
            self._part = before

    def status(self, text: str) -> None:
        """Say what is going on, on stderr."""
        checkpoint()
        text = visible(text)
        _log.info("%s", text)
        if self._lines is not None:
            self._lines.interrupted = True
        if not self.quiet or text.startswith("warning:"):
            self._stderr.print(text, markup=False, highlight=False, soft_wrap=True)

    def table(
        self, title: str, columns: Sequence[str], rows: Sequence[Sequence[object]], caption: str | None = None
    ) -> None:
        """Print a table of results on stdout, of a `part` on stderr; with JSON it is left to `result`."""
        title, caption = visible(self._title(title)), visible(caption or "")
        columns = [visible(column) for column in columns]
        rows = [_visible_cells(row) for row in rows]
        _log.info("%s", "\n".join([title, *("\t".join(map(str, row)) for row in [columns, *rows]), caption]))
        if self.json:
            return
        above_live_table = self._live is not None and self._stdout.is_terminal
        if self.quiet and self._part:
            return
        place = self._stderr if above_live_table or self._part else self._stdout
        place.print(title, style="bold", markup=False, highlight=False, soft_wrap=True)
        widths = fitting(columns, rows, place.width, leave_out=place.is_terminal)
        if not place.is_terminal:
            place.width = max(WIDTH_WITHOUT_TERMINAL, total(widths))
        place.print(draw_table(columns, rows, widths))
        left = columns[len(widths) :]
        more = f"{len(left)} more in a wider window: {', '.join(left)}" if left else ""
        if below := "\n".join(filter(None, [more, caption])):
            place.print(below + "\n", markup=False, highlight=False, soft_wrap=True)

    def draw(self, thing: rich.console.RenderableType) -> None:
        """Print what rich can draw on stdout; with JSON it is left to `result`."""
        if not self.json:
            self._stdout.print(thing, soft_wrap=True)

    def result(self, document: Mapping[str, Any], *, text: str = "") -> None:
        """Print the outcome: the document as JSON, or `text` for a person."""
        if self.json:
            from gsl.storage.documents import text as strict_json

            sys.stdout.write(visible(strict_json(document, indent=2)) + "\n")
        elif text:
            sys.stdout.write(visible(text).rstrip("\n") + "\n")
        sys.stdout.flush()

    def error(self, message: str, exit_code: int, *, command: str = "gsl") -> int:
        """Say in one line why the command ends, and return the exit code."""
        message = visible(" ".join(message.splitlines()))  # what it names may hold line ends
        _log.info("%s", message)
        if self.json:
            self.result({"error": message, "exit_code": exit_code})
        else:
            with suppress(OSError):  # the disk may be full to which stdout goes, and that is what is told
                sys.stdout.flush()
            sys.stderr.write(f"{visible(command)}: {message}\n")
        return exit_code

    @contextmanager
    def progress(self, total: int, description: str) -> Iterator[Progress]:
        """Show how far a loop of `total` steps is: a bar on a terminal, else a line every ten seconds."""
        description = visible(description)
        if self._live is not None:
            yield _Lines(total, description, self._live.caption, seconds=0.5)
        elif self.quiet or not self._stderr.is_terminal:
            yield _Lines(total, description, self.status, seconds=SECONDS_BETWEEN_LINES)
        else:
            from rich.progress import Progress as Bars
            from rich.progress import TimeElapsedColumn

            with Bars(*Bars.get_default_columns(), TimeElapsedColumn(), console=self._stderr, transient=True) as bars:
                task = bars.add_task(description, total=total)
                yield _Bar(lambda steps: bars.advance(task, steps))

    @contextmanager
    def live_table(self, title: str, columns: Sequence[str]) -> Iterator[LiveTable]:
        """Show a growing table on a terminal, else each row as a line; the final table is for `table`."""
        title = visible(self._title(title))
        if self.quiet or not self._stderr.is_terminal or self._live is not None:
            self._lines = LineTable(title, columns, self.status)
            try:
                yield self._lines
            finally:
                self._lines = None
            return
        from rich.live import Live

        with Live(console=self._stderr, transient=True) as live:
            self._live = RichLiveTable(title, columns, live)
            try:
                yield self._live
            finally:
                self._live = None

    def _title(self, title: str) -> str:
        return f"{self._part}: {title}" if self._part else title

    @cached_property
    def _stdout(self) -> rich.console.Console:
        return _rich_console(sys.stdout.isatty(), stderr=False)

    @cached_property
    def _stderr(self) -> rich.console.Console:
        return _rich_console(sys.stderr.isatty(), stderr=True)


class _Bar:
    def __init__(self, draw: Callable[[int], None]) -> None:
        self.draw = draw

    def advance(self, steps: int = 1) -> None:
        checkpoint()
        self.draw(steps)


class _Lines:
    """Progress as lines of text, not more often than every so many seconds."""

    def __init__(self, total: int, description: str, say: Callable[[str], None], *, seconds: float) -> None:
        self.total, self.description, self.say, self.seconds = total, description, say, seconds
        self.done, self.said = 0, time.monotonic()
        self.begun = self.said

    def advance(self, steps: int = 1) -> None:
        checkpoint()
        self.done += steps
        if time.monotonic() - self.said >= self.seconds:
            self.said = time.monotonic()
            left = (self.total - self.done) * (self.said - self.begun) / self.done if self.done else 0.0
            self.say(f"{self.description}: {self.done} of {self.total}, {duration(left)} left")


def _visible_cells(cells: Sequence[object]) -> list[object]:
    return [visible(cell) if isinstance(cell, str) else cell for cell in cells]


def _rich_console(is_terminal: bool, *, stderr: bool) -> rich.console.Console:
    from rich.console import Console as RichConsole

    return RichConsole(stderr=stderr, width=None if is_terminal else WIDTH_WITHOUT_TERMINAL)
