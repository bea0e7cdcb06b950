"""The first screen of a diagnosis: verdict, where, cause, how far it shrinks, what next."""

from __future__ import annotations

from markupsafe import Markup

from gsl.report.diagnosis_missing import missing_sentence
from gsl.report.diagnosis_next import Step, steps
from gsl.report.diagnosis_verdict import (
    cause_name,
    comparison_sentence,
    list_open_groups,
    nearest,
    shrinkage_sentence,
    sureness,
    verdict,
    where_sentence,
)
from gsl.report.diagnosis_words import Document, entries, interval, name, part, read_word, value
from gsl.report.parts import Part, bullets, command, element, join, prose


def cards(document: Document) -> list[tuple[str, Markup]]:
    """Return the questions of the first screen with their answers."""
    if verdict(document) == "wiring":
        sentences = [prose(read_word(finding, "sentence")) for finding in entries(document, "wiring")]
        steps_to_take = element("ol", *(_step(step) for step in steps(document)))
        return [("What is wrong?", join(bullets(sentences))), ("What next?", steps_to_take)]
    extent = "How large is it?" if verdict(document) == "no_gap" else "How far does it shrink?"
    return [
        ("Where is the gap?", element("p", prose(where_sentence(document)))),
        ("What causes it?", _cause(document)),
        (extent, join(element("p", prose(shrinkage_sentence(document))), _aside(document))),
        ("What next?", element("ol", *(_step(step) for step in steps(document)))),
    ]


def _aside(document: Document) -> Markup | None:
    sentence = comparison_sentence(document)
    return element("p", prose(sentence), kind="note") if sentence else None


def _cause(document: Document) -> Markup:
    causes = [_one(cause) for cause in entries(document, "causes")]
    groups = list_open_groups(document)
    if causes or groups:
        return join(*causes, bullets(groups))
    return element("p", prose(_nothing(document)))


def _nothing(document: Document) -> str:
    if verdict(document) == "no_gap":
        return "Nothing that this log can show."
    near = f"The nearest: {nearest(document)}." if nearest(document) else ""
    return " ".join(filter(None, ["None of the known effects.", near, missing_sentence(document)]))


def _one(cause: Document) -> Markup:
    rows = [_parameter(key, estimate or {}) for key, estimate in part(cause, "parameters").items()]
    return element(
        "div",
        element("p", element("strong", cause_name(cause)), kind="cause"),
        element("p", str(cause["meaning"]), kind="note") if cause.get("meaning") else None,
        element("p", *(part for row in rows for part in row), kind="parameters") if rows else None,
        element("p", prose(sureness(cause))) if sureness(cause) else None,
    )


def _parameter(key: str, estimate: Document) -> tuple[Part, ...]:
    bounds = interval(estimate)
    shown = element("span", name(key), " ", element("b", value(estimate)), f" ({bounds})" if bounds else None)
    return shown, " "


def _step(step: Step) -> Markup:
    more = element("span", step.more, kind="note") if step.more else None
    return element("li", step.why, " ", more, command(step.command))
