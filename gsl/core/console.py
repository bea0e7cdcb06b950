"""What a stage says while it works: the interface of the console, which is silent itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Protocol

from gsl.core.workload import Part


class Progress(Protocol):
    """How far a long loop is."""

    def advance(self, steps: int = 1, *, worked: bool = True) -> None:
        """Say that `steps` more are done; without work if they were done before."""

    def fell(self, count: int) -> None:
        """Say that the robot fell so often."""

    def best(self, text: str) -> None:
        """Say the best value so far, in words."""


class LiveTable(Protocol):
    """A table that grows while a person watches."""

    def row(self, *cells: object) -> None:
        """Add a row."""


class Console:
    """Where a stage says what it is at, and shows results; this one shows nothing."""

    def status(self, text: str) -> None:
        """Say what is going on."""

    def table(
        self, title: str, columns: Sequence[str], rows: Sequence[Sequence[object]], caption: str | None = None
    ) -> None:
        """Show a table of results."""

    @contextmanager
    def at_work(self, name: str) -> Iterator[None]:
        """Within, it is shown that work of this name goes on, from the first seconds on."""
        yield

    def phase(self, name: str) -> None:
        """Say what is done now, of which nobody knows how long it takes."""

    @property
    def has_plan(self) -> bool:
        """Whether it was said how long the work around takes, or nobody listens: a part of it says nothing then."""
        return True

    @contextmanager
    def plan(self, noun: str, parts: Sequence[Part]) -> Iterator[None]:
        """Within, the work, or a part of the plan around, consists of parts that `noun` names."""
        yield

    def begin(self, name: str) -> None:
        """Say which part of the plan begins."""

    def finish(self, *, worked: bool = True) -> None:
        """Say that a part of the plan is done; without work if it was done before."""

    @contextmanager
    def progress(self, total: int, description: str) -> Iterator[Progress]:
        """Show how far a loop of `total` steps is."""
        yield _Unseen()

    @contextmanager
    def live_table(self, title: str, columns: Sequence[str]) -> Iterator[LiveTable]:
        """Show a table that grows."""
        yield _Unseen()

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Within, tables belong to a part of the work that has this name."""
        yield


Silent = Console


class _Unseen:
    def advance(self, steps: int = 1, *, worked: bool = True) -> None:
        pass

    def fell(self, count: int) -> None:
        pass

    def best(self, text: str) -> None:
        pass

    def row(self, *cells: object) -> None:
        pass
