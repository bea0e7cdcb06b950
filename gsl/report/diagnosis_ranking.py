"""The explanations that competed, and what the causes among them are in numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from markupsafe import Markup

from gsl.report.charts import Dot, dot_chart
from gsl.report.diagnosis_verdict import cause_name
from gsl.report.diagnosis_words import (
    NONE,
    Document,
    between,
    entries,
    finite,
    interval,
    name,
    part,
    probability,
    read_word,
    share,
    short,
)
from gsl.report.diagnosis_words import (
    value as shown,
)
from gsl.report.parts import Part, element, join, section, table

SHOWN = 12


def causes(document: Document) -> Markup | None:
    """Return every fitted parameter of the causes as it stands in the corrected simulator."""
    rows = [row for cause in entries(document, "causes") for row in _parameters(cause)]
    columns = ("cause", "parameter", "value", "95 % interval", "in the file", "sure", "gap that returns without it")
    return section("The causes in numbers", table(columns, rows) if rows else None)


def _parameters(cause: Document) -> list[tuple[Part, ...]]:
    """The rows of a cause; its name and what holds for all its parameters are told in the first."""
    whole = (probability(cause.get("probability")), share(part(cause, "gain").get("value")))
    rows: list[tuple[Part, ...]] = []
    for key in part(cause, "parameters"):
        estimate = part(part(cause, "parameters"), key)
        number = finite(estimate.get("value"))
        file = element("code", NONE if number is None else f"{number:.4g} {estimate.get('unit') or ''}".strip())
        fitted = (element("code", str(key)), shown(estimate), interval(estimate) or NONE, file)
        rows.append((None, *fitted, None, None) if rows else (cause_name(cause), *fitted, *whole))
    return rows


def ranking(document: Document) -> Markup | None:
    """Return the hypotheses with what each explains, as dots with whiskers."""
    hypotheses = entries(document, "ranking")
    least = finite(document.get("least_gain")) or 20.0
    shares = all(abs(finite(part(hypothesis, "gain").get("value")) or 0.0) <= 1.5 for hypothesis in hypotheses)
    form = share if shares else short
    chosen = sorted((str(cause.get("effect")), read_word(cause, "scope")) for cause in entries(document, "causes"))
    dots = [_dot(hypothesis, chosen=_what(hypothesis) == chosen) for hypothesis in hypotheses[:SHOWN]]
    rows = [_row(hypothesis, form, chosen=_what(hypothesis) == chosen) for hypothesis in hypotheses[:SHOWN]]
    share_of = "the share of what a calibration of each joint leaves that it explains (outliers count for less)"
    measure = share_of if shares else "the cost that it saves"
    note = (
        f"Each was fitted on some records and judged on others. Shown: {measure}, with its 95 % interval (left of the "
        "line it makes things worse). What costs more does so than the verdict, which is in colour. An effect has "
        f"to save {least:,.0f} over calibration alone here, or to free much of what its unusual values cost; how sure "
        "a difference between two explanations is, is the probability of the causes."
    )
    rest = f"{len(hypotheses) - SHOWN} more did worse." if len(hypotheses) > SHOWN else None
    return section(
        "Explanations that competed",
        dot_chart(dots, form),
        table(("explanation", "explains", "95 % interval", "costs more", "best", "remark"), rows, kind="words")
        if rows
        else None,
        element("p", rest, kind="note") if rest else None,
        note=note,
    )


def _dot(hypothesis: Document, *, chosen: bool) -> Dot:
    value, low, high = (finite(part(hypothesis, "gain").get(key)) for key in ("value", "low", "high"))
    return Dot(_name(hypothesis), value, low, high, "after" if chosen else "other")


def _row(hypothesis: Document, form: Callable[[Any], str], *, chosen: bool) -> tuple[Part, ...]:
    gain, behind = part(hypothesis, "gain"), finite(hypothesis.get("behind"))
    fitted = str(hypothesis.get("parameters") or "")
    return (
        join(_name(hypothesis), element("span", f" {fitted}", kind="note") if fitted else None),
        form(gain.get("value")),
        between(gain, form),
        "" if behind is None or chosen else f"{behind:+,.0f}".replace("-", "−"),
        probability(hypothesis["probability"]) if finite(hypothesis.get("probability")) is not None else "",
        f"passed over: {hypothesis['passed_over']}"
        if hypothesis.get("passed_over")
        else "the verdict"
        if chosen
        else "",
    )


def _what(hypothesis: Document) -> list[tuple[str, str]]:
    return sorted(zip(map(str, entries(hypothesis, "effects")), map(str, entries(hypothesis, "scopes")), strict=False))


def _name(hypothesis: Document) -> str:
    effects, scopes = entries(hypothesis, "effects"), [str(scope) for scope in entries(hypothesis, "scopes")]
    scopes += [""] * (len(effects) - len(scopes))
    names = " + ".join(
        cause_name({"effect": effect, "joints": scope}) for effect, scope in zip(effects, scopes, strict=False)
    )
    return name(names) or "calibration alone"
