"""A table of the paper with ours beside it: one study, and the figures of all its trials in the paper's own form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, fields
from pathlib import Path
from typing import Annotated, Any, ClassVar, Protocol, runtime_checkable

from gsl.core.console import Console
from gsl.core.interfaces import Search, Task
from gsl.core.setting import component, setting
from gsl.core.unit import Unit
from gsl.errors import ConfigError
from gsl.report.study_page import write_study_page
from gsl.report.style import save
from gsl_experiments.answer import answer_comparison
from gsl_experiments.compare import TABLE, Compare
from gsl_experiments.comparison import summaries
from gsl_experiments.effort import check_search, seconds
from gsl_experiments.paper_cells import Drawn, one_by_one
from gsl_experiments.sizes import sizes_of, trials_of
from gsl_experiments.trial import Trial
from gsl_experiments.trials_picture import trials_figure
from gsl_experiments.tried import foretelling

FIGURE, TRIALS = "trials.png", "trials.md"


@runtime_checkable
class PaperTable(Protocol):
    """How the trials of a study are told.

    Where it tells one kind of task alone, `of: ClassVar[type]` says which.
    """

    def markdown(self, trials: Sequence[Trial], task: Task) -> str:
        """Return the table with the paper's figures beside ours."""

    def select(self, trials: Sequence[Trial], task: Task) -> Drawn:
        """Return what is drawn of every trial."""


@component
class Reproduce(Compare):
    """A comparison whose trials are told as the paper's are."""

    kind: ClassVar[str] = "reproduce"

    table: Annotated[PaperTable, setting("how the trials are shown")] = field(kw_only=True)

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Say beforehand how long it takes, run all trials, write every trial's figures, the table and the picture.

        Raises:
            ConfigError: Its optimizer is no search, or its table tells another task.
        """
        kind, task = getattr(self.table, "of", Task), self.iterate.task
        if not isinstance(task, kind):
            kinds = f"{type(self.table).__name__} of {type(task).__name__}"
            raise ConfigError("table", f"tells of {kind.__name__} alone; choose another table=", given=kinds)
        check_search(self.iterate, "iterate")
        if absent := sorted(_list_named(self.table) - self.methods.keys()):
            console.status(f"no methods here, so that the table sets nothing against them: {', '.join(absent)}")
        trials, made = self.carry_out(folder, console, lambda: seconds(self))
        texts = filter(None, (self.table.markdown(trials, task), foretelling(trials)))
        parts = [*texts, f"{sizes_of(self.preset_name)} {_sizes(self)}\n", made]
        (folder / TABLE).write_text("\n".join(parts) + "\n", encoding="utf-8")
        (folder / TRIALS).write_text(one_by_one(trials, task), encoding="utf-8")
        picture = trials_figure(trials, self.methods, self.table.select(trials, task), tolerant=self.tolerant)
        summary = summaries(trials)
        answer = answer_comparison(summary, trials, Unit.of(task))
        write_study_page(folder, answer, [TABLE, TRIALS], [save(picture, folder / FIGURE)])
        return self.metrics(summary, answer)


def _list_named(table: PaperTable) -> set[str]:
    """Return the methods that a table's settings list."""
    values = (getattr(table, field.name) for field in fields(table))  # type: ignore[arg-type]
    return {name for value in values if isinstance(value, tuple) for name in value if isinstance(name, str)}


def _sizes(study: Compare) -> str:
    """Return the sizes behind a table."""
    budget, optimizer = study.iterate.budget, study.iterate.optimizer
    assert isinstance(optimizer, Search), "check_search() has refused others"
    searched = (
        f"{optimizer.generations} generations of {optimizer.candidates} candidates, {budget.rollouts} rollouts each"
    )
    measured = f"{budget.episodes} for the choice, {budget.check} for the check, {budget.confirmation} for the report"
    trials = trials_of(study.first, study.trials)
    return f"{trials}. A search: {searched}. {budget.in_words.capitalize()}. Real episodes: {measured}."
