"""The console is the only place that prints: people read progress on stderr, results go to stdout."""

from __future__ import annotations

import logging
import os
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from gsl.core.console import Console as Interface
from gsl.core.console import LiveTable, Progress
from gsl.core.interruption import checkpoint
from gsl.core.visible import visible
from gsl.core.workload import Part, Workload
from gsl.report.tables import GrowingTable, LineTable, draw_table, fitting, total

if TYPE_CHECKING:
    import rich.console
    import rich.live

_log = logging.getLogger("gsl")

SECONDS_BETWEEN_LINES = 10.0
SILENCE = 1.0  # of a command after which a first line says what it does [s]; many are done before
PULSE = 0.25  # between looks whether a line is due [s]
WIDTH_WITHOUT_TERMINAL = 200
BAR = 60  # characters
WARNING = "warning: "  # begins what is said even when quiet


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


class Console(Interface):
    """Prints for a person, or exactly one JSON document on stdout.

    Attributes:
        quiet: Whether all consoles leave out what is no result, warning or error.
    """

    quiet: ClassVar[bool] = False

    def __init__(self, *, json: bool = False) -> None:
        self.json = json
        self._live: rich.live.Live | None = None
        self._growing: GrowingTable | None = None
        self._lines: LineTable | None = None
        self._part = ""
        self._work = Workload(self._note_progress)
        self._said, self._pulse = self._work.clock(), False

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
        if self._part:  # a reader of all warnings of a study has to know which trial each is of
            text = text.replace(WARNING, f"{WARNING}{self._part}: ", 1) if text.startswith(WARNING) else text
        text = visible(text)
        _log.info("%s", text)
        if self._lines is not None:
            self._lines.interrupted = True
        if not self.quiet or text.startswith(WARNING.rstrip()):
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
            place = self._stderr if self._live is not None and self._stdout.is_terminal else self._stdout
            place.print(thing, soft_wrap=True)

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
    def at_work(self, name: str) -> Iterator[None]:
        """Within, it is shown that work of this name goes on, from the first seconds on."""
        self._said = self._work.clock() + SILENCE - SECONDS_BETWEEN_LINES
        with self._work.at_work(visible(name)), self._watch():
            yield

    def phase(self, name: str) -> None:
        """Say what is done now, of which nobody knows how long it takes."""
        _log.info("%s", visible(name))
        self._work.enter(visible(name))

    @property
    def has_plan(self) -> bool:
        """Whether it was said how long the work around takes."""
        return self._work.has_plan

    @contextmanager
    def plan(self, noun: str, parts: Sequence[Part]) -> Iterator[None]:
        """Within, the work, or a part of the plan around, consists of parts that `noun` names."""
        with self._work.plan(noun, parts), self._watch():
            yield

    def begin(self, name: str) -> None:
        """Say which part of the plan begins."""
        self._work.begin(visible(name))

    def finish(self, *, worked: bool = True) -> None:
        """Say that a part of the plan is done; without work if it was done before."""
        self._work.finish(worked=worked)

    @contextmanager
    def progress(self, total: int, description: str) -> Iterator[Progress]:
        """Show how far a loop of `total` steps is: live on a terminal, else in a line every ten seconds at most."""
        with self._work.loop(total, visible(description)) as loop, self._watch():
            yield loop

    @contextmanager
    def live_table(self, title: str, columns: Sequence[str]) -> Iterator[LiveTable]:
        """Show a growing table on a terminal, else each row as a line; the final table is for `table`."""
        title, nested = visible(self._title(title)), self._growing is not None
        try:
            with self._watch():
                if self._live is None or nested:
                    self._lines = LineTable(title, columns, self.status)
                    yield self._lines
                else:
                    self._growing = GrowingTable(title, columns)
                    yield self._growing
        finally:
            self._lines = None
            self._growing = self._growing if nested else None

    @contextmanager
    def _watch(self) -> Iterator[None]:
        """Within, it is shown how far the work is, whether or not the work itself says anything."""
        if self._live is not None or self._pulse or self.quiet:
            yield
            return
        if not self._stderr.is_terminal or self._stderr.is_dumb_terminal:
            with self._pulsate():
                yield
            return
        from rich.live import Live

        with Live(console=self._stderr, transient=True, get_renderable=self._draw_progress) as self._live:
            try:
                yield
            finally:
                self._live = None

    @contextmanager
    def _pulsate(self) -> Iterator[None]:
        """Within, lines are printed while the work says nothing, such as when it compiles."""
        over, self._pulse = threading.Event(), True

        def look() -> None:
            while not over.wait(PULSE):
                with suppress(OSError):  # nobody reads stderr any more
                    self._say_progress()

        thread = threading.Thread(target=look, daemon=True)
        thread.start()
        try:
            yield
        finally:
            self._pulse = False
            over.set()
            thread.join()

    def _draw_progress(self) -> rich.console.Group:
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        shown: list[rich.console.RenderableType] = []
        if self._growing is not None:
            shown.append(self._growing.draw(self._stderr.width))
        if words := self._work.text():
            below = Table.grid()
            if self._work.share:
                below.add_row(ProgressBar(total=1.0, completed=self._work.share, width=min(BAR, self._stderr.width)))
            below.add_row(Text(visible(self._title(words))))
            shown.append(below)
        return Group(*shown)

    def _note_progress(self) -> None:
        checkpoint()
        self._say_progress()

    def _say_progress(self) -> None:
        now = self._work.clock()
        if self._live is not None or self.quiet or now - self._said < SECONDS_BETWEEN_LINES:
            return
        if text := self._work.text():
            self._said = now
            if self._lines is not None:
                self._lines.interrupted = True
            self._stderr.print(visible(self._title(text)), markup=False, highlight=False, soft_wrap=True)

    def _title(self, title: str) -> str:
        return f"{self._part}: {title}" if self._part else title

    @cached_property
    def _stdout(self) -> rich.console.Console:
        return _rich_console(sys.stdout.isatty(), stderr=False)

    @cached_property
    def _stderr(self) -> rich.console.Console:
        return _rich_console(sys.stderr.isatty(), stderr=True)


def _visible_cells(cells: Sequence[object]) -> list[object]:
    return [visible(cell) if isinstance(cell, str) else cell for cell in cells]


def _rich_console(is_terminal: bool, *, stderr: bool) -> rich.console.Console:
    from rich.console import Console as RichConsole

    # Where no colours are wanted there is no bold either; the live display alone moves the cursor.
    colours: Any = None if os.environ.get("NO_COLOR") else "auto"
    width = None if is_terminal else WIDTH_WITHOUT_TERMINAL
    return RichConsole(stderr=stderr, width=width, color_system=colours)
