"""The report of a diagnosis: one HTML file that needs nothing else, the answer on its first screen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gsl.report.diagnosis_answers import cards
from gsl.report.diagnosis_limits import limits
from gsl.report.diagnosis_method import calibration, caveats, method, noise_floor, self_test
from gsl.report.diagnosis_missing import missing
from gsl.report.diagnosis_policies import policies
from gsl.report.diagnosis_ranking import causes, ranking
from gsl.report.diagnosis_replays import replays
from gsl.report.diagnosis_shrinkage import parts, shrinkage
from gsl.report.diagnosis_verdict import headline, summary, verdict
from gsl.report.diagnosis_where import growth, sides, where
from gsl.report.diagnosis_words import Document, part
from gsl.report.page import page
from gsl.report.parts import clean, prose
from gsl.report.run_page import describe_origin
from gsl.storage.origin import origin

_SECTIONS = (
    caveats,
    where,
    growth,
    sides,
    causes,
    missing,
    limits,
    ranking,
    shrinkage,
    parts,
    replays,
    policies,
    calibration,
    noise_floor,
    self_test,
    method,
)
_MARKS = {"no_gap": "✓", "causes": "!", "inseparable": "?", "unknown": "?", "wiring": "!"}


def report_html(document: Document) -> str:
    """Return the page of a diagnosis.

    Args:
        document: report.json; every list may be empty, every optional part None or absent.
    """
    document = _clean(document)
    data, kind = part(document, "data"), verdict(document)
    sides = [str(data[key]) for key in ("sim", "source") if data.get(key)]
    return page(
        "diagnosis.html",
        [*(section(document) for section in _SECTIONS), *describe_origin(origin())],
        title=f"Diagnosis: {headline(document)}",
        kind=kind,
        mark=_MARKS[kind],
        kicker=" against ".join(sides) or "gsl diagnose",
        headline=headline(document),
        summary=[prose(text)] if (text := summary(document)) else [],
        cards=cards(document),
    )


def _clean(thing: Any) -> Any:
    """Return a document whose words can be drawn."""
    if isinstance(thing, Mapping):
        return {clean(str(key)): _clean(value) for key, value in thing.items()}
    if isinstance(thing, list | tuple):
        return [_clean(value) for value in thing]
    return clean(thing) if isinstance(thing, str) else thing
