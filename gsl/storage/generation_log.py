"""The log of a search: one record a generation, written when it is complete; a search resumes by reading it again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gsl.storage.records import Records

FILE = "generations.jsonl"


class Generation(NamedTuple):
    """Values and falls of all candidates of a generation, in the order in which they were asked for.

    Attributes:
        number: Of the generation, from 0.
        values: What the search maximises.
        falls: How often each fell.
        means: Mean values of the episodes, where the search maximises something else.
        played: Episodes of each, where some stopped early.
    """

    number: int
    values: list[float]
    falls: list[int]
    means: list[float] | None = None
    played: list[int] | None = None

    @property
    def winner(self) -> int:
        """Index of the best candidate, which has played all episodes."""
        if self.played is None:
            return int(np.argmax(self.values))
        whole = np.equal(self.played, max(self.played))
        return int(np.argmax(np.where(whole, self.values, -np.inf)))


class GenerationLog:
    """The generations done so far in a folder; what is damaged, or was cut short by a kill, does not count.

    Args:
        folder: Of the search.
        say: Is told in a line what does not count.
    """

    def __init__(self, folder: Path, say: Callable[[str], None] = lambda text: None) -> None:
        self._records = Records(folder / FILE, say)

    def read(self, index: int) -> Generation | None:
        """Return a generation that is done, to the bit as it was."""
        done = self._records.records
        return Generation(**done[index]) if index < len(done) else None

    def append(self, generation: Generation) -> None:
        """Add the next generation, on disk before anything goes on."""
        assert generation.number == len(self._records.records), "generations come in order"
        self._records.append({name: value for name, value in generation._asdict().items() if value is not None})
