"""What a log leaves room for: how much of an effect that was not named there may be all the same."""

from __future__ import annotations

from markupsafe import Markup

from gsl.report.diagnosis_words import Document, entries, finite, in_unit, list_words, name, read_word
from gsl.report.parts import element, section, table

TOLD = 4  # in a terminal


def limits(document: Document) -> Markup | None:
    """Return the effects of which there is little or none."""
    rows = [
        (
            name(read_word(limit, "effect")),
            element("code", read_word(limit, "parameter")),
            _at(limit, "most"),
            _at(limit, "documented"),
        )
        for limit in entries(document, "limits")
    ]
    note = (
        "If the causes are right and nothing else is at work: more of an effect, in all joints alike, makes held-out "
        "replays significantly worse. To a factor of 1.4; one joint alone may have more, and another model of the "
        "servos says something else."
    )
    columns = ("effect", "parameter", "at most", "looked for up to")
    return section("What else there may be", table(columns, rows) if rows else None, note=note)


def limits_sentence(document: Document) -> str | None:
    """Return the tightest limits in a sentence, None if there are none."""
    tightest = entries(document, "limits")
    phrases = [f"{name(read_word(limit, 'effect'))} {_at(limit, 'most')}" for limit in tightest[:TOLD]]
    more = [f"{len(tightest) - TOLD} more, in the report"] if len(tightest) > TOLD else []
    subject = "If these causes are right, all" if entries(document, "causes") else "All"
    return f"{subject} joints alike have at most: {list_words([*phrases, *more], most=99)}." if phrases else None


def _at(limit: Document, key: str) -> str:
    value = finite(limit.get(key)) or 0.0
    return in_unit({"unit": limit.get("unit"), "value": value, "low": 0.0, "high": 2.0 * value})(value)
