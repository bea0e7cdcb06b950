"""The explanations that competed, and what the causes among them are in numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gsl.report.diagnosis_bars import Dot, dot_chart
from gsl.report.diagnosis_html import Html, Part, element, join, prose, section, table
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

SHOWN = 12


def causes(document: Document) -> Html | None:
    """Return every fitted parameter of the causes as it stands in the corrected simulator."""
    rows = [row for cause in entries(document, "causes") for row in _parameters(cause)]
    columns = ("cause", "parameter", "value", "95 % interval", "in the file", "sure", "of the rest, back without it")
    return section("The causes in numbers", table(columns, rows) if rows else None)


def _parameters(cause: Document) -> list[tuple[Part, ...]]:
    """The rows of a cause; its name and what holds for all its parameters are told in the first."""
    whole = (probability(cause.get("probability")), share(part(cause, "gain").get("value")))
    rows: list[tuple[Part, ...]] = []
    for key in part(cause, "parameters"):
        found = part(part(cause, "parameters"), key)
        number = finite(found.get("value"))
        file = element("code", NONE if number is None else f"{number:.4g} {found.get('unit') or ''}".strip())
        fitted = (element("code", str(key)), shown(found), interval(found) or NONE, file)
        rows.append((None, *fitted, None, None) if rows else (cause_name(cause), *fitted, *whole))
    return rows


def ranking(document: Document) -> Html | None:
    """Return the hypotheses with what each explains, as dots with whiskers."""
    found = entries(document, "ranking")
    least = finite(document.get("least_gain")) or 20.0
    shares = all(abs(finite(part(one, "gain").get("value")) or 0.0) <= 1.5 for one in found)
    form = share if shares else short
    chosen = sorted((str(cause.get("effect")), read_word(cause, "scope")) for cause in entries(document, "causes"))
    dots = [_dot(one, form, chosen=_what(one) == chosen) for one in found[:SHOWN]]
    share_of = "the share of what a calibration of each joint leaves that it explains (outliers count for less)"
    measure = share_of if shares else "the cost that it saves"
    note = (
        f"Each was fitted on some records and judged on others. Shown: {measure}, with its 95 % interval (left of the "
        "line it makes things worse), and how much more it costs than the verdict, which is in colour. An effect has "
        f"to save {least:,.0f} over calibration alone here, to be more than chance; how sure a difference between two "
        "explanations is, is the probability of the causes."
    )
    rest = f"{len(found) - SHOWN} more did worse." if len(found) > SHOWN else None
    return section(
        "Explanations that competed",
        dot_chart(dots, form),
        element("p", rest, class_="note") if rest else None,
        note=note,
    )


def _dot(one: Document, form: Callable[[Any], str], *, chosen: bool) -> Dot:
    gain = part(one, "gain")
    bounds = between(gain, form)
    told = [f"{form(gain.get('value'))}{f' ({bounds})' if bounds else ''}"]
    behind = finite(one.get("behind"))
    told += [] if behind is None or chosen else [f"costs {behind:+,.0f}".replace("-", "−")]
    told += [f"passed over: {one['passed_over']}"] if one.get("passed_over") else []
    told += [f"best: {probability(one['probability'])}"] if finite(one.get("probability")) is not None else []
    value, low, high = (finite(gain.get(key)) for key in ("value", "low", "high"))
    return Dot(_label(one), value, low, high, prose(", ".join(told)), "after" if chosen else "other")


def _what(one: Document) -> list[tuple[str, str]]:
    return sorted(zip(map(str, entries(one, "effects")), map(str, entries(one, "scopes")), strict=False))


def _label(one: Document) -> Html:
    effects, scopes = entries(one, "effects"), [str(scope) for scope in entries(one, "scopes")]
    scopes += [""] * (len(effects) - len(scopes))
    told = " + ".join(
        cause_name({"effect": effect, "joints": scope}) for effect, scope in zip(effects, scopes, strict=False)
    )
    fitted = str(one.get("parameters") or "")
    return join(
        element("strong", name(told) or "calibration alone"),
        element("span", f" {fitted}", class_="note") if fitted else None,
    )
