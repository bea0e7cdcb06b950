"""The words and numbers of a diagnosis as a person reads them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

Document = Mapping[str, Any]
"""What `gsl diagnose` writes as report.json, or a part of it."""

NONE = "–"
LARGEST = 1e150  # number of a report that is shown: squares of larger ones are none any more
REGIMES = {
    "all": "always",
    "rest": "at rest",
    "slow": "slow",
    "fast": "fast",
    "reversal": "turning round",
    "high_load": "asked for much torque",
    "saturated": "saturated",
    "after_contact": "after contact",
    "stance": "in stance",
    "swing": "in swing",
    "early": "early",
    "late": "late",
}
"""When a joint is looked at, in the order in which it is shown."""


def entries(document: Document | None, key: str) -> list[Any]:
    """Return a list of a document, empty if it is absent or None."""
    return list((document or {}).get(key) or [])


def part(document: Document | None, key: str) -> Document:
    """Return a mapping of a document, empty if it is absent or None."""
    return (document or {}).get(key) or {}


def finite(value: Any) -> float | None:
    """Return a number, None if it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > LARGEST:
        return None
    return float(value) if math.isfinite(value) else None


def read_word(document: Document, key: str) -> str:
    """Return a word of a document, a dash if it is absent or None."""
    value = document.get(key)
    return NONE if value is None else str(value)


def short(value: Any, digits: int = 3) -> str:
    """Return a number with a few significant digits and no exponent where it can be avoided."""
    number = finite(value)
    if number is None:
        return NONE
    if number and not 1e-4 <= abs(number) < 1e6:
        return f"{number:.{digits}g}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(number)))) if number else 0
    return f"{number:.{decimals}f}".replace("-", "−")


def share(value: Any) -> str:
    """Return a share of a whole in percent."""
    number = finite(value)
    return NONE if number is None else f"{100.0 * number:.0f} %".replace("-0 %", "0 %").replace("-", "−")


def probability(value: Any) -> str:
    """Return a probability in percent; it is never told to be certain."""
    number = finite(value)
    if number is None:
        return NONE
    return ">99 %" if number > 0.99 else "<1 %" if number < 0.01 else share(number)


def level(value: Any) -> str:
    """Return a multiple of the noise floor."""
    number = finite(value)
    if number is None:
        return NONE
    return "<0.01 ×" if 0.0 <= number < 0.01 else f"{number:.{2 if number < 10.0 else 0}f} ×"


def between(bounds: Document, form: Callable[[Any], str]) -> str:
    """Return the interval of `low` and `high`, nothing if there is none; a unit is told once."""
    low, high = bounds.get("low"), bounds.get("high")
    if finite(low) is None or finite(high) is None:
        return ""
    first, last = form(low), form(high)
    unit = last[last.rfind(" ") :] if " " in last else "°" if last.endswith("°") else ""
    return f"{first.removesuffix(unit) if unit else first} to {last}"


def name(effect: str) -> str:
    """Return the name of an effect or a parameter as words."""
    return str(effect).replace("_", " ")


def list_words(words: Sequence[Any], last: str = "and", *, most: int = 4) -> str:
    """Return words with commas, those beyond `most` only counted."""
    shown = [str(word) for word in words]
    if len(shown) > most:
        shown = [*shown[: most - 1], f"{len(shown) - most + 1} more"]
    return f" {last} ".join(filter(None, [", ".join(shown[:-1]), shown[-1]])) if shown else ""


def scope(joints: Any) -> str:
    """Return where an effect acts, in words; nothing if that is nowhere in particular."""
    names = [joints] if isinstance(joints, str) else list(joints or [])
    return list_words(["all joints" if joint == "all" else joint for joint in names if joint])


def regime(kind: str) -> str:
    """Return when it was looked at, in words."""
    return REGIMES.get(kind, name(kind))


def in_unit(parameter: Document) -> Callable[[Any], str]:
    """Return how values of a fitted parameter are told: angles in degrees, short times in ms, digits as its interval.

    Args:
        parameter: `value`, `low`, `high` and `unit`.
    """
    unit = str(parameter.get("unit") or "")
    factor, shown = {"rad": (180.0 / math.pi, "°"), "rad/s": (180.0 / math.pi, " °/s")}.get(unit, (1.0, f" {unit}"))
    if unit == "s" and abs(finite(parameter.get("value")) or 0.0) < 1.0:
        factor, shown = 1000.0, " ms"
    low, high = finite(parameter.get("low")), finite(parameter.get("high"))
    width = 0.0 if low is None or high is None else factor * (high - low)

    def form(value: Any) -> str:
        number = finite(value)
        if number is None:
            return NONE
        digits = (
            _decimals(factor * number, max(0, math.ceil(-math.log10(width / 5.0) - 1e-6))) if width > 1e-4 else None
        )
        return (digits or short(factor * number)) + shown.rstrip()

    return form


def _decimals(number: float, count: int) -> str:
    return f"{number:.{count}f}".replace("-", "−")


def value(parameter: Document) -> str:
    """Return the value of a fitted parameter with its unit."""
    return in_unit(parameter)(parameter.get("value"))


def interval(parameter: Document) -> str:
    """Return the interval of a fitted parameter with its unit."""
    return between(parameter, in_unit(parameter))
