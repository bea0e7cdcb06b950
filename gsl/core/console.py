"""What a stage tells while it works: the interface of the console, and one that is silent."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol


class Progress(Protocol):
    """How far a long loop is."""

    def advance(self, steps: int = 1) -> None:
        """Say that `steps` more are done."""


class LiveTable(Protocol):
    """A table that grows while a person watches."""

    def row(self, *cells: object) -> None:
        """Add a row."""


class Console(Protocol):
    """Where a stage says what it is at, and shows results."""

    def status(self, text: str) -> None:
        """Say what is going on."""

    def table(
        self, title: str, columns: Sequence[str], rows: Sequence[Sequence[object]], caption: str | None = None
    ) -> None:
        """Show a table of results."""

    def progress(self, total: int, description: str) -> AbstractContextManager[Progress]:
        """Show how far a loop of `total` steps is."""

    def live_table(self, title: str, columns: Sequence[str]) -> AbstractContextManager[LiveTable]:
        """Show a table that grows."""

    def part(self, name: str) -> AbstractContextManager[None]:
        """Within, tables belong to a part of the work that has this name."""


class Silent:
    """A console that shows nothing."""

    def status(self, text: str) -> None:
        """Say nothing."""

    def table(
        self, title: str, columns: Sequence[str], rows: Sequence[Sequence[object]], caption: str | None = None
    ) -> None:
        """Show nothing."""

    @contextmanager
    def progress(self, total: int, description: str) -> Iterator[Progress]:
        """Yield progress that is shown nowhere."""
        yield _Unseen()

    @contextmanager
    def live_table(self, title: str, columns: Sequence[str]) -> Iterator[LiveTable]:
        """Yield a table that is shown nowhere."""
        yield _Unseen()

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Name nothing."""
        yield


class _Unseen:
    def advance(self, steps: int = 1) -> None:
        pass

    def row(self, *cells: object) -> None:
        pass
