"""The report of a diagnosis: one HTML file that needs nothing else, the answer on its first screen."""

from __future__ import annotations

from gsl.report.diagnosis_answers import answers
from gsl.report.diagnosis_html import element
from gsl.report.diagnosis_limits import limits
from gsl.report.diagnosis_look import STYLE
from gsl.report.diagnosis_method import calibration, caveats, method, noise_floor, self_test
from gsl.report.diagnosis_policies import policies
from gsl.report.diagnosis_ranking import causes, ranking
from gsl.report.diagnosis_replays import replays
from gsl.report.diagnosis_shrinkage import parts, shrinkage
from gsl.report.diagnosis_verdict import headline
from gsl.report.diagnosis_where import growth, sides, where
from gsl.report.diagnosis_words import Document

_SECTIONS = (
    caveats,
    where,
    growth,
    sides,
    causes,
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
_FRAME = (
    '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
    '<meta name="viewport" content="width=device-width, initial-scale=1">'
    '<meta name="color-scheme" content="light dark">'
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">"
)


def report_html(document: Document) -> str:
    """Return the page of a diagnosis.

    Args:
        document: report.json; every list may be empty, every optional part None or absent.
    """
    body = element("main", answers(document), *(told(document) for told in _SECTIONS))
    title = element("title", f"Diagnosis: {headline(document)}")
    return f"{_FRAME}{title}{STYLE}</head>\n<body>{body}</body></html>\n"
