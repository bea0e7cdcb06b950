"""The first screen of a diagnosis: verdict, where, cause, how far it shrinks, what next."""

from __future__ import annotations

from gsl.report.diagnosis_html import Html, Part, bullets, element, join, prose
from gsl.report.diagnosis_next import Step, steps
from gsl.report.diagnosis_verdict import (
    alternatives,
    cause_name,
    comparison_sentence,
    headline,
    nearest,
    shrinkage_sentence,
    sureness,
    verdict,
    where_sentence,
)
from gsl.report.diagnosis_words import Document, entries, interval, name, part, value

_MARKS = {"no_gap": "✓", "causes": "!", "inseparable": "?", "unknown": "?"}


def answers(document: Document) -> Html:
    """Return the first screen."""
    cards = [
        _card("Where is the gap?", element("p", prose(where_sentence(document)))),
        _card("What causes it?", _cause(document)),
        _card(
            "How large is it?" if verdict(document) == "no_gap" else "How far does it shrink?",
            element("p", prose(shrinkage_sentence(document))),
            _aside(document),
        ),
        _card("What next?", element("ol", *(_step(step) for step in steps(document)))),
    ]
    return join(_head(document), element("div", *cards, class_="answers"))


def _head(document: Document) -> Html:
    data, kind = part(document, "data"), verdict(document)
    sides = [str(data[key]) for key in ("sim", "source") if data.get(key)]
    return element(
        "header",
        element("p", " against ".join(sides) or "gsl diagnose", class_="kicker"),
        element("h1", element("span", _MARKS[kind], class_="mark", aria_hidden="true"), " ", headline(document)),
        element("p", prose(str(document["summary"]))) if document.get("summary") else None,
        class_=f"verdict {kind}",
    )


def _card(question: str, *answer: Part) -> Html:
    return element("div", element("h2", question), *answer, class_="card")


def _aside(document: Document) -> Html | None:
    told = comparison_sentence(document)
    return element("p", prose(told), class_="note") if told else None


def _cause(document: Document) -> Html:
    causes = [_one(cause) for cause in entries(document, "causes")]
    groups = [f"{alternatives(group)}: this log cannot tell which" for group in entries(document, "inseparable")]
    if causes or groups:
        return join(*causes, bullets(groups))
    return element("p", prose(_nothing(document)))


def _nothing(document: Document) -> str:
    if verdict(document) == "no_gap":
        return "Nothing that this log can show."
    near = nearest(document)
    return f"None of the known effects. The nearest: {near}." if near else "None of the known effects."


def _one(cause: Document) -> Html:
    rows = [_parameter(key, found or {}) for key, found in part(cause, "parameters").items()]
    return element(
        "div",
        element("p", element("strong", cause_name(cause)), class_="cause"),
        element("p", str(cause["meaning"]), class_="note") if cause.get("meaning") else None,
        element("p", *(part for row in rows for part in row), class_="parameters") if rows else None,
        element("p", prose(sureness(cause))) if sureness(cause) else None,
    )


def _parameter(key: str, found: Document) -> tuple[Part, ...]:
    bounds = interval(found)
    shown = element("span", name(key), " ", element("b", value(found)), f" ({bounds})" if bounds else None)
    return shown, " "


def _step(step: Step) -> Html:
    lines = [element("code", f"{line}\n") for line in step.command.splitlines()]
    command = element("pre", *lines) if lines else None
    return element("li", join(step.why, " ", element("span", step.more, class_="note") if step.more else None), command)
