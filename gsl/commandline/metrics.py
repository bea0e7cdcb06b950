"""`gsl metrics`: the metrics of the generations and epochs of a run, as a table, as JSON, or for TensorBoard."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated

from gsl.commandline.words import split_words
from gsl.core.setting import component, setting
from gsl.core.validation import make
from gsl.core.words import in_unit
from gsl.errors import ArtifactError, InputError
from gsl.report.account import plain
from gsl.report.console import Console
from gsl.report.headline import unit_of
from gsl.report.tensorboard import write_events
from gsl.storage import manifest
from gsl.storage.artifact import Artifact
from gsl.storage.references import artifact_folders, name_run
from gsl.storage.step_metrics import Step, read_steps
from gsl.storage.whole import explain_refusal

SEARCHES = ("search", "learner")  # series whose steps are of a task
VALUES = ("best", "mean", "value")  # of their metrics, those that have its unit


@component
class Metrics:
    """What `gsl metrics` takes beside the reference."""

    tensorboard: Annotated[str, setting("a new folder for TensorBoard's event files, one folder an artifact")] = ""


def show_metrics(reference: str, words: Sequence[str], console: Console) -> None:
    """Show the metrics of the steps of all artifacts that are meant, and write them for TensorBoard if asked.

    Raises:
        ArtifactError: There is no such artifact, or none that notes steps.
        ConfigError: A setting is wrong.
        InputError: The folder is there already, or the library is missing.
    """
    settings = make(Metrics, split_words(words, "metrics"))
    by_folder = {folder: steps for folder in artifact_folders(reference) if (steps := read_steps(folder))}
    by_artifact = {name_run(folder): steps for folder, steps in by_folder.items()}
    if not by_artifact:
        raise ArtifactError(reference, "has no metrics of steps: searches and networks that are fitted note them")
    if settings.tensorboard:
        place = Path(settings.tensorboard)
        if place.exists():
            raise InputError(f"{place}: exists; choose another tensorboard=, or take it away")
        with explain_refusal(place.parent):
            for name, steps in by_artifact.items():
                write_events(place.joinpath(*(part for part in Path(name).parts if part not in ("/", ".."))), steps)
        console.status(f"tensorboard --logdir {place.as_posix()} shows them")
    for folder, steps in by_folder.items():
        name, made = name_run(folder), Artifact(folder, manifest.read(folder))
        for series in dict.fromkeys(step.series for step in steps):
            console.table(f"{name}: {series}", *_tabulate([step for step in steps if step.series == series], made))
    document = {name: [step._asdict() for step in steps] for name, steps in by_artifact.items()}
    console.result({"artifacts": document}, text=settings.tensorboard)


def _tabulate(steps: Sequence[Step], made: Artifact) -> tuple[list[str], list[tuple[str, ...]]]:
    """Return a table in the unit of the task; times are from the start of the work, or of its first part."""
    keys, unit = list(dict.fromkeys(key for step in steps for key in step.values)), unit_of(made)
    begun = min(datetime.fromisoformat(made.manifest.created).timestamp(), *(step.time for step in steps))
    valued = VALUES if steps[0].series in SEARCHES else ()

    def cell(key: str, value: float | None) -> str:
        return unit.bare(value) if key in valued else plain(value)

    rows = [
        (str(step.run), str(step.step), f"{step.time - begun:.1f}", *(cell(k, step.values.get(k)) for k in keys))
        for step in steps
    ]
    return ["run", "step", "time [s]", *(in_unit(key, unit.name) if key in valued else key for key in keys)], rows
