"""What is missing where no effect explains a gap: the form that a law of each servo gives to it."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from markupsafe import Markup

from gsl.core.slides import unit_of_slide
from gsl.report.charts import Curve, line_chart
from gsl.report.diagnosis_words import Document, entries, finite, list_words, name, part, read_word, share
from gsl.report.parts import element, prose, section, table

WORDS: Mapping[str, str] = {
    "gain": "another gain or zero",
    "inertia": "another inertia",
    "lag": "a lag",
    "speed": "a function of speed",
    "load": "a function of the error, which the servo's torque follows",
    "position": "a function of position",
    "reversal": "a function of the way since it turned round",
    "time": "a function of time",
}
_AXES: Mapping[str, str] = {
    "gain": "error [rad]",
    "inertia": "change of speed in a control period [rad/s]",
    "speed": "speed [rad/s]",
    "load": "error [rad]",
    "position": "position [rad]",
    "reversal": "way since it turned round [rad]",
    "time": "time in the episode [s]",
}
LEAST = 5e-4  # of a lag that is written in whole milliseconds [s]
ALIKE = 0.9  # share of the best form's share from which on another one does as well


def list_missing(document: Document) -> list[str]:
    """Return of which form what is missing is, a line for each joint; none if that is not known."""
    return [f"{read_word(form, 'joint')}: {_words(form)}" for form in entries(document, "forms")]


def missing_sentence(document: Document) -> str:
    """Return the same in a sentence."""
    joints = list_missing(document)
    return f"What is missing looks like this. {'; '.join(joints)}." if joints else ""


def _words(form: Document) -> str:
    best, shares = read_word(form, "form"), part(form, "shares")
    most, late = finite(shares.get(best)) or 0.0, finite(form.get("late"))
    others = [key for key in shares if key != best and (finite(shares[key]) or 0.0) > ALIKE * most > 0.0]
    words = [WORDS.get(key, name(key)) for key in (best, *others)]
    late = late if late is None or abs(late) >= LEAST else None
    by = f" ({_milliseconds(late)})" if late is not None and "lag" in (best, *others) else ""
    return list_words(words, "or") + by


def _milliseconds(late: float) -> str:
    return f"{abs(1e3 * late):.0f} ms {'late' if late >= 0.0 else 'early'}"


def _axis(form: Document, slides: Collection[str]) -> str:
    words = _AXES.get(read_word(form, "form"), name(read_word(form, "form")))
    return unit_of_slide(words) if read_word(form, "joint") in slides else words


def missing(document: Document) -> Markup | None:
    """Return what a law of each servo says of a gap that no effect explains."""
    forms, slides = entries(document, "forms"), document.get("slides") or []
    kinds = [kind for kind in WORDS if kind != "gain" and any(kind in part(form, "shares") for form in forms)]
    rows = [
        (
            read_word(form, "joint"),
            *(share(part(form, "shares").get(kind)) for kind in kinds),
            "" if (late := finite(form.get("late"))) is None else _milliseconds(late),
        )
        for form in forms
    ]
    drawn = [
        line_chart(
            [Curve(read_word(form, "joint"), "after", form.get("x") or [], form.get("y") or [])],
            x=_axis(form, slides),
            y="missing force [N]" if read_word(form, "joint") in slides else "missing torque [N·m]",
        )
        for form in forms
    ]
    note = (
        "A small law of each servo was learned on top of the best effects, and explains held-out motions significantly "
        "better than these. Shares: what terms of one form explain on their own, of what a law explains beyond gains "
        "and a zero of the simulator as it is. Forms that are alike in these motions have about the same share."
    )
    parts = [element("p", prose(missing_sentence(document))), table(("joint", *kinds, "all in all"), rows), *drawn]
    return section("What is missing", *(parts if forms else ()), note=note)
