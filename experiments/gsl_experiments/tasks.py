"""A trial as a task: workers run trials side by side, and the study notes what they have built."""

from __future__ import annotations

import pickle
import socket
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from gsl.core.console import Console, Silent
from gsl.core.workload import Part
from gsl.errors import GslError
from gsl.rollout.cluster import find_cluster
from gsl.rollout.parallel import Workers, arriving
from gsl.stages.iterate import Iterate
from gsl.storage.artifact import Artifact, collect_links, note


class Study(Protocol):
    """What has trials."""

    @property
    def iterate(self) -> Iterate:
        """What a trial is."""

    def results(self, home: Path, item: Any, console: Console) -> Iterable[Any]:
        """Return the results of a part of a trial, a named tuple each, built below `home`."""


class Task(NamedTuple):
    """Parts of one trial, in their order: later ones take what earlier ones have built."""

    folder: Path
    items: Sequence[Any]


def in_order(
    study: Study, folder: Path, trials: Mapping[int, Sequence[Any]], console: Console, seconds: float = 0.0,
    links: Callable[[Any], Sequence[Part]] = lambda _: (),
) -> Iterator[tuple[Any, list[Any]]]:  # fmt: skip
    """Yield each part of all trials with its results: one after the other, or on a cluster trials side by side.

    Args:
        study: Whose trials.
        folder: In which its artifact is being built.
        trials: Parts by the number of the trial.
        console: Where progress is shown.
        seconds: About how long all of it takes [s], 0 if nobody knows.
        links: Returns the links of a part of a trial, if anybody knows them.
    """
    if find_cluster() is not None:
        yield from side_by_side(study, folder, trials, -1, console, seconds)
        return
    items = [item for items in trials.values() for item in items]
    with console.plan("result", [Part(seconds / max(len(items), 1))] * len(items)):
        for item in items:
            with console.plan("stage", links(item)):
                results = list(study.results(folder.parent, item, console))
            console.finish()
            yield item, results


def side_by_side(
    study: Study, folder: Path, trials: Mapping[int, Sequence[Any]], workers: Workers, console: Console,
    seconds: float = 0.0,
) -> Iterator[tuple[Any, list[Any]]]:  # fmt: skip
    """Yield each part of all trials with its results, trials as they end.

    Args:
        study: Whose trials.
        folder: In which its artifact is being built.
        trials: Parts by the number of the trial.
        workers: Processes, where no cluster was chosen.
        console: Where progress is shown.
        seconds: About how long all of it takes [s], 0 if nobody knows.

    Raises:
        GslError: A worker does not see the study's folder.
    """
    alone = replace(study, iterate=replace(study.iterate, workers=1))  # type: ignore[type-var]
    tasks = [Task(folder, items) for items in trials.values()]
    with console.plan("", [Part(seconds, len(tasks))]), console.progress(len(tasks), "trials") as progress:
        for index, (results, links) in arriving(_run, alone, tasks, workers, progress):
            for link in links:
                note(link)
            yield from zip(tasks[index].items, results, strict=True)


def _run(frozen: bytes, task: Task) -> tuple[list[list[Any]], list[Artifact]]:
    """Return the results of a trial, part by part, and the artifacts that it consists of."""
    study: Study = pickle.loads(frozen)  # noqa: S301  our own bytes, from the parent process
    if not task.folder.is_dir():
        where = f"worker on {socket.gethostname()}: sees no {task.folder.absolute()}"
        raise GslError(f"{where}; start the study in a folder that all machines share")
    with collect_links() as links:
        results = [list(study.results(task.folder.parent, item, Silent())) for item in task.items]
    return results, list(links.values())
