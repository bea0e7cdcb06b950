"""The metrics of an artifact's steps: `metrics.jsonl`, one line a generation or epoch, which only grows.

It says when each step was done, and takes no part in the hash of the artifact's contents.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from gsl.core.budget import DOCUMENT_BYTES, read_text
from gsl.errors import ArtifactError, InputError
from gsl.storage.hashing import STEPS
from gsl.storage.manifest import REMEDY


class Step(NamedTuple):
    """One line.

    Attributes:
        stage: Kind of the artifact.
        series: What takes steps, such as `search` or `network`.
        run: Which of several such series, from 1: a stage may fit several networks.
        step: Its number, from 1.
        time: When it was done [s since 1970].
        values: By name; None where a value was not finite.
    """

    stage: str
    series: str
    run: int
    step: int
    time: float
    values: dict[str, float | None]


class StepLog:
    """Writes the lines of a folder's work; work that goes on leaves those of steps that it repeats as they were."""

    def __init__(self, folder: Path, stage: str) -> None:
        self._path, self._stage = folder / STEPS, stage
        self._last: dict[str, tuple[int, int]] = {}
        steps = list(_read_whole(self._path)) if self._path.exists() else []
        self._there = {(line.series, line.run, line.step) for line in steps}
        if steps:  # a line that a kill cut short goes
            self._path.write_text("".join(map(_write, steps)), encoding="utf-8")

    def note(self, series: str, step: int, values: dict[str, float]) -> None:
        """Add a line; steps that begin anew are of another run of the series."""
        run, last = self._last.get(series, (1, 0))
        run += step <= last
        self._last[series] = run, step
        if (series, run, step) in self._there:
            return
        finite = {name: float(value) if math.isfinite(value) else None for name, value in values.items()}
        with self._path.open("a", encoding="utf-8") as file:
            file.write(_write(Step(self._stage, series, run, step, round(time.time(), 3), finite)))


def read_steps(folder: Path) -> list[Step]:
    """Return the steps of an artifact, none if it notes none.

    Raises:
        ArtifactError: The file is damaged.
    """
    path = folder / STEPS
    if not path.exists():
        return []
    try:
        lines = read_text(path, DOCUMENT_BYTES).splitlines()
        return [_parse(line) for line in lines]
    except (ValueError, TypeError, AttributeError, OverflowError, RecursionError, InputError) as error:
        raise ArtifactError(path, f"is damaged; {REMEDY}") from error


def _read_whole(path: Path) -> Iterator[Step]:
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            yield _parse(line)
        except (ValueError, TypeError, AttributeError, OverflowError, RecursionError):
            return


def _write(step: Step) -> str:
    return json.dumps(step._asdict()) + "\n"


def _parse(line: str) -> Step:
    step = Step(**json.loads(line))
    values = {str(name): None if value is None else float(value) for name, value in step.values.items()}
    return Step(str(step.stage), str(step.series), int(step.run), int(step.step), float(step.time), values)
