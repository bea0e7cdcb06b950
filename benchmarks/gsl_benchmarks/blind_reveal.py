"""Reveal a blind benchmark: check every seal, set the answers against the labels, and count."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

from gsl.core.console import Console
from gsl.core.setting import component, setting
from gsl.errors import ArtifactError, GslError
from gsl.storage import documents
from gsl.storage.hashing import file_hash
from gsl.storage.step_metrics import read_steps
from gsl_benchmarks.blind.figures import figures
from gsl_benchmarks.blind.files import ANSWERS, BASELINES, LABELS, SEAL, SEALS, answers_below, document, find, seals_of
from gsl_benchmarks.blind.label import WALK, Label
from gsl_benchmarks.blind.mark import Mark, mark_answer
from gsl_benchmarks.blind.results import OURS, markdown, results
from gsl_benchmarks.blind.seals import check_label

DATA, TABLE = "results.json", "results.md"


@component
class BlindReveal:
    """Labels, nonces, data and answers have to be those that were sealed."""

    kind: ClassVar[str] = "blind_reveal"

    data: Annotated[str, setting("folder of the cases", min_length=1)]
    answers: Annotated[str, setting("folder of the answers", min_length=1)]
    labels: Annotated[str, setting("folder of the labels", min_length=1)]

    def parents(self) -> Mapping[str, Path]:
        """Return the seals of data and answers, and the labels."""
        return {
            "data": find(self.data, SEALS, "blind_make"),
            "answers": find(self.answers, SEAL, "blind_answer"),
            "labels": find(self.labels, LABELS, "blind_make"),
        }

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the results as JSON and as markdown."""
        files = self.parents()
        labels = _labels(files["data"], files["labels"])
        _check_answers(files["data"], files["answers"])
        place = files["answers"].parent
        seconds = {line.series: line.values for line in read_steps(place)}
        marks = {OURS: _marks(labels, place / ANSWERS, OURS, seconds)}
        in_the_air = {name: label for name, label in labels.items() if label.kind != WALK}
        baselines = sorted((place / BASELINES).glob("*"))
        marks |= {path.name: _marks(in_the_air, path, path.name, seconds) for path in baselines}
        documents.write_json(folder / DATA, results(marks))
        seals = f"data {file_hash(files['data'])[:16]}, answers {document(files['answers'], total=str)['total'][:16]}"
        about = f"{len(labels)} cases; every seal holds ({seals})."
        (folder / TABLE).write_text(markdown(marks, about), encoding="utf-8")
        judged = [figure for figure in figures(marks[OURS]) if figure.met is not None]
        met = sum(bool(figure.met) for figure in judged)
        return {
            "headline": f"{met} of {len(judged)} thresholds are met in {len(labels)} cases",
            "cases": len(labels),
            "met": met,
            "judged": len(judged),
            "figures": {f"{figure.name}, {figure.generator}": figure.value for figure in judged},
        }


def _labels(seals: Path, path: Path) -> dict[str, Label]:
    """Return the labels by case, having checked their seals and the data's."""
    entries = document(path, cases=dict)["cases"]
    cases = seals_of(seals)
    for name, seal in cases.items():
        if not isinstance(entry := entries.get(name), dict) or not isinstance(entry.get("label"), dict):
            raise ArtifactError(path, f"has no label of {name}; copy it again")
        check_label(path, name, seal["label"], entry)
    return {name: _label(path, name, entries[name]["label"]) for name in cases}


def _label(path: Path, name: str, entry: Mapping[str, Any]) -> Label:
    try:
        return Label.of(entry)
    except (TypeError, ValueError, AttributeError) as error:
        raise ArtifactError(path, f"the label of {name} is none: {error}") from error


def _check_answers(seals: Path, path: Path) -> None:
    """Refuse answers that were changed after they were sealed, or are to other data."""
    sealed, folder = document(path, data=str, answers=dict), path.parent
    if sealed["data"] != file_hash(seals):
        raise GslError(f"{path}: these are answers to other data than {seals.parent}")
    there = answers_below(folder)
    for name in sorted({*there, *sealed["answers"]}):
        if there.get(name) != sealed["answers"].get(name):
            raise GslError(f"{folder}: the seal of {name} does not hold, the answer was changed after it was given")


def _marks(
    labels: Mapping[str, Label], folder: Path, who: str, seconds: Mapping[str, Mapping[str, float | None]]
) -> list[Mark]:
    """Return the marks of the answers in a folder; how long they took is not sealed and may be missing."""
    return [_mark(label, folder / f"{name}.json", seconds.get(name, {}).get(who)) for name, label in labels.items()]


def _mark(label: Label, path: Path, seconds: float | None) -> Mark:
    """Set an answer against its label; it may be of any program.

    Raises:
        ArtifactError: It is no answer.
    """
    answer = {"seconds": seconds, **document(path, verdict=str)}
    try:
        return mark_answer(label, answer)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        problem = f"is no answer as docs/reference/blind.md has it ({type(error).__name__}: {error})"
        raise ArtifactError(path, problem) from error
