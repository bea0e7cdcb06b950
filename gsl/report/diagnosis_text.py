"""A diagnosis as a terminal shows it: a few small tables, the answer first."""

from __future__ import annotations

from collections.abc import Iterator

from gsl.report.diagnosis_limits import limits_sentence
from gsl.report.diagnosis_missing import list_missing
from gsl.report.diagnosis_next import steps
from gsl.report.diagnosis_policies import policy_lines
from gsl.report.diagnosis_verdict import (
    alternatives,
    cause_name,
    comparison_sentence,
    headline,
    list_open_groups,
    nearest,
    places,
    shrinkage_sentence,
    summary,
    verdict,
)
from gsl.report.diagnosis_words import (
    Document,
    between,
    entries,
    interval,
    level,
    name,
    part,
    probability,
    read_word,
    share,
    value,
)
from gsl.report.tables import Table

CAUSES, JOINTS, CAVEATS = 8, 5, 3  # rows at most


def summary_lines(document: Document) -> list[Table]:
    """Return what a terminal shows: what was found, where, and what to do next."""
    where = _where(document)
    return [_causes(document), *([where] if where.rows else []), _next(document)]


def _causes(document: Document) -> Table:
    said = "\n".join(filter(None, [summary(document), *policy_lines(document)])) or None
    if verdict(document) == "wiring":
        findings = [
            (read_word(finding, "kind"), read_word(finding, "sentence")) for finding in entries(document, "wiring")
        ]
        return Table(headline(document), ("kind", "what is wrong"), findings)
    rows = [*_list_causes(document)]
    if not rows:
        alike = [("either", alternatives(group)) for group in entries(document, "inseparable")]
        alike += [("nearest", nearest(document))] if nearest(document) else []
        alike += [("missing" if k == 0 else "", line) for k, line in enumerate(list_missing(document))]
        return Table(headline(document), ("", ""), [*alike, *_shrinkage(document)], said)
    columns = ("cause", "parameter", "value", "95 % interval", "probability", "gap that returns without it")
    more = [f"and {len(rows) - CAUSES} more, in the report"] if len(rows) > CAUSES else []
    lines = "\n".join([*more, *filter(None, [said]), *list_open_groups(document)])
    return Table(headline(document), columns, rows[:CAUSES], lines or None)


def _list_causes(document: Document) -> Iterator[tuple[str, ...]]:
    for cause in entries(document, "causes"):
        first = cause_name(cause)
        last = probability(cause.get("probability")), share(part(cause, "gain").get("value"))
        for key, fitted in (part(cause, "parameters") or {"": {}}).items():
            shown = (name(key), value(fitted or {}), interval(fitted or {})) if key else ("", "", "")
            yield first, *shown, *last
            first, last = "", ("", "")


def _shrinkage(document: Document) -> list[tuple[str, str]]:
    sentences = {"gap": shrinkage_sentence(document), "beside": comparison_sentence(document)}
    return [(key, sentence) for key, sentence in sentences.items() if sentence]


def _where(document: Document) -> Table:
    worst = places(document)
    rows = [
        (
            place.joint,
            share(place.cell.get("share")),
            between(place.cell, share),
            level(place.cell.get("rms")),
            place.when,
        )
        for place in worst[:JOINTS]
    ]
    columns = ("joint", "share of the excess", "95 % interval", "gap / noise", "most when")
    more = f" (and {len(worst) - JOINTS} more joints)" if len(worst) > JOINTS else ""
    shrinks = shrinkage_sentence(document) if entries(document, "causes") else None
    return Table(f"where the gap is{more}", columns, rows, shrinks)


def _next(document: Document) -> Table:
    files = {"report": "report", "world_file": "corrected simulator"}
    rows = [(words, str(document[key])) for key, words in files.items() if document.get(key)]
    doubts = [str(caveat) for caveat in entries(document, "caveats")]
    more = [f"{len(doubts) - CAVEATS} more of these in the report"] if len(doubts) > CAVEATS else []
    lines = [*filter(None, [limits_sentence(document)]), *(f"Mind: {caveat}" for caveat in doubts[:CAVEATS]), *more]
    lines += [
        text for step in steps(document) for text in (step.why, *(f"    {line}" for line in step.command.splitlines()))
    ]
    return Table("what next", ("", ""), rows or [("report", "report.html")], "\n".join(lines))
