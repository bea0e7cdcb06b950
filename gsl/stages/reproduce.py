"""A table of the paper with ours beside it: one study, and the figures of all its trials in the paper's own form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Protocol, runtime_checkable

from gsl.core.setting import component, setting
from gsl.stages.compare import DATA, TABLE, Compare
from gsl.stages.comparison import summaries
from gsl.stages.study_effort import seconds, told
from gsl.stages.trial import Trial
from gsl.storage.documents import write_json
from gsl.tasks.task import Task


@runtime_checkable
class PaperTable(Protocol):
    """How the trials of a study are told."""

    def markdown(self, trials: Sequence[Trial], task: Task) -> str:
        """Return the table with the paper's figures beside ours."""


@component
class Reproduce:
    """What is built is not built again: a stopped study goes on."""

    kind: ClassVar[str] = "reproduce"

    study: Annotated[Compare, setting("what is run")]
    table: Annotated[PaperTable, setting("how it is told")]

    def parents(self) -> Mapping[str, Path]:
        """Everything is made here."""
        return {}

    def run(self, folder: Path, console: Any) -> Mapping[str, Any]:
        """Run the study, say beforehand how long that takes, and write every trial's figures and the table."""
        console.status(f"{told(seconds(self.study))} from nothing; a study that was stopped goes on where it was")
        trials = self.study.carried_out(folder.parent, console)
        write_json(folder / DATA, [trial._asdict() for trial in trials])
        (folder / TABLE).write_text(self.table.markdown(trials, self.study.iterate.task), encoding="utf-8")
        return {"trials": len(trials), "summaries": [one._asdict() for one in summaries(trials)]}
