"""The log of a search: one line a generation, written when it is complete; a search resumes by reading it again."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import NamedTuple

FILE = "generations.jsonl"


class Generation(NamedTuple):
    """Values and falls of all candidates of a generation, in the order in which they were asked for.

    Attributes:
        number: Of the generation, from 0.
        values: What the search maximises.
        falls: How often each fell.
        means: Mean values of the episodes, where the search maximises something else.
    """

    number: int
    values: list[float]
    falls: list[int]
    means: list[float] | None = None


class GenerationLog:
    """The generations done so far in a folder; a line that a kill cut short does not count."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        lines = self._path.read_text(encoding="utf-8").split("\n")[:-1] if self._path.exists() else []
        self._done = [Generation(**json.loads(line)) for line in lines]
        if self._path.exists():
            os.truncate(self._path, sum(len(line.encode()) + 1 for line in lines))

    def read(self, index: int) -> Generation | None:
        """Return a generation that is done, to the bit as it was."""
        return self._done[index] if index < len(self._done) else None

    def append(self, generation: Generation) -> None:
        """Add the next generation, on disk before anything goes on."""
        assert generation.number == len(self._done), "generations come in order"
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({k: v for k, v in generation._asdict().items() if v is not None}) + "\n")
            file.flush()
            os.fsync(file.fileno())
        self._done.append(generation)
