"""An audit of a log's wiring in words: its findings as a table, and what its verdict means."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

HEADLINES = {
    "clean": "The wiring is in order",
    "unclear": "The wiring fits, but a shift by rows and a latency look alike here",
    "wiring": "It is wiring",
}

Table = tuple[str, tuple[str, ...], Sequence[tuple[str, ...]], str]


def audit_table(document: Mapping[str, Any]) -> Table:
    """Return title, columns, rows and what is said below them."""
    rows = [(one["kind"], _sentence(one), one["remedy"], _floors(one)) for one in document["findings"]]
    below = list(document["remarks"])
    if not rows:
        return HEADLINES[document["verdict"]], ("", ""), [("audit", document["summary"])], "\n".join(below)
    below.append("Mend this first: a diagnosis would take it for physics.")
    columns = ("kind", "what is wrong", "what to do", "gap / noise")
    return HEADLINES[document["verdict"]], columns, rows, "\n".join(below)


def _sentence(one: Mapping[str, Any]) -> str:
    return " Or: ".join([one["sentence"], *one["or"]])


def _floors(one: Mapping[str, Any]) -> str:
    if one["before"] is None:
        return ""
    return f"{one['before']:.1f} -> {one['after']:.1f}"
