"""The results of a benchmark as a document, and as markdown for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from gsl.report.markdown import table
from gsl_benchmarks.blind.figures import Figure, calibration_error, confusion, figures, reliability, truth_of
from gsl_benchmarks.blind.label import FOREIGN, SAME
from gsl_benchmarks.blind.mark import Mark, right

OURS = "gsl"
COLUMNS = ("figure", "same generator", "needed", "foreign generator", "needed")
COMPARED = (
    *("top-1, medium and strong", "top-2, medium and strong", "two effects: both named"),
    *("fault of one joint: right joint", "false alarm without a cause", "abstains, effect never in the library"),
)


def results(marks: Mapping[str, Sequence[Mark]]) -> dict[str, Any]:
    """Return everything that is counted, of the diagnosis and of each baseline by name."""
    return {name: _of_one(own) for name, own in marks.items()}


def _of_one(marks: Sequence[Mark]) -> dict[str, Any]:
    seconds = [mark.seconds for mark in marks]
    return {
        "cases": len(marks),
        "figures": [{**asdict(figure), "met": figure.met} for figure in figures(marks)],
        "reliability": {
            generator: [
                {"probability": said, "right": hit, "count": count}
                for said, hit, count in reliability([m for m in marks if m.label.generator == generator])
            ]
            for generator in (SAME, FOREIGN)
        },
        "ece": calibration_error(marks)[0],
        "confusion": confusion(marks),
        "longest_seconds": max(seconds, default=0.0),
        "marks": [_row(mark) for mark in marks],
    }


def markdown(marks: Mapping[str, Sequence[Mark]], about: str) -> str:
    """Return the results as markdown; the first table is the one of the figures.

    Args:
        marks: Of the diagnosis, by OURS, and of each baseline.
        about: A line on the benchmark.
    """
    own = marks[OURS]
    wrong = [mark for mark in own if not right(mark)]
    counted = {truth: [f"{name} {count}" for name, count in row.items()] for truth, row in confusion(own).items()}
    answers = [(truth, ", ".join(row)) for truth, row in counted.items()]
    parts = [
        f"# Blind benchmark\n\n{about}\n",
        table(COLUMNS, figure_rows(own)),
        "Shares have Wilson's 95 % interval, medians that of order statistics; in brackets what was counted.\n",
        "## Reliability\n",
        table(("generator", "said", "right", "causes"), _reliability_rows(own)),
        "## Answers by truth\n",
        "In brackets what the library that answered did not have. Cases of two effects are left out.\n",
        table(("truth", "answers"), answers),
        "## Baselines\n" if len(marks) > 1 else "",
        table(("figure", *marks), _compare(marks)) if len(marks) > 1 else "",
        "## Every answer that is not right\n",
        table(("case", "kind", "generator", "strength", "gap", "truth", "answer"), [_describe(mark) for mark in wrong]),
    ]
    return "\n".join(part for part in parts if part)


def figure_rows(marks: Sequence[Mark]) -> list[tuple[str, ...]]:
    """Return a row for each figure: its name, then value and threshold of both generators."""
    both = figures(marks)
    pairs = zip(both[: len(both) // 2], both[len(both) // 2 :], strict=True)
    return [
        (first.name, _format(first), _format_threshold(first), _format(second), _format_threshold(second))
        for first, second in pairs
    ]


def _format(figure: Figure) -> str:
    if figure.value is None:
        return "-"
    digits = 0 if "[s]" in figure.name else 2
    bounds = "" if figure.low is None else f" ({figure.low:.{digits}f} to {figure.high:.{digits}f})"
    return f"{figure.value:.{digits}f}{bounds} [{figure.count}]"


def _format_threshold(figure: Figure) -> str:
    if figure.threshold is None:
        return ""
    word = {True: ", met", False: ", missed", None: ""}[figure.met]
    return f"{'≥' if figure.least else '≤'} {figure.threshold:.2f}{word}"


def _reliability_rows(marks: Sequence[Mark]) -> list[tuple[str, ...]]:
    return [
        (generator, f"{said:.2f}", f"{hit:.2f}", str(count))
        for generator in (SAME, FOREIGN)
        for said, hit, count in reliability([mark for mark in marks if mark.label.generator == generator])
    ]


def _compare(marks: Mapping[str, Sequence[Mark]]) -> list[tuple[str, ...]]:
    """Return both generators' figures of every method, one row a figure."""
    rows = []
    for generator in (SAME, FOREIGN):
        of_all = [{f.name: f for f in figures(own) if f.generator == generator} for own in marks.values()]
        rows += [(f"{name}, {generator}", *(_format(by_name[name]) for by_name in of_all)) for name in COMPARED]
    return rows


def _describe(mark: Mark) -> tuple[str, ...]:
    label = mark.label
    answer = ", ".join(mark.named) if mark.named else mark.answer
    probability = "" if mark.probability is None else f" ({mark.probability:.2f})"
    where = "" if mark.joint is None else f", {'right' if mark.joint else 'wrong'} joint"
    text = f"{answer}{probability}{where}"
    return label.case, label.kind, label.generator, label.strength, f"{label.gap:.1f}", truth_of(mark), text


def _row(mark: Mark) -> dict[str, Any]:
    counted = {key: value for key, value in asdict(mark).items() if key != "label"}
    label = mark.label
    own = {key: getattr(label, key) for key in ("case", "kind", "generator", "strength", "gap")}
    return {**own, "truth": truth_of(mark), "whole": right(mark), **counted}
