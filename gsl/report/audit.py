"""An audit of a log's wiring in words: its findings as a table, and what its verdict means."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gsl.report.tables import Table

HEADLINES = {
    "clean": "The wiring is in order",
    "unclear": "The wiring fits, but physics and a fault look alike in one thing",
    "wiring": "It is wiring",
}


def audit_table(document: Mapping[str, Any]) -> Table:
    """Return title, columns, rows and what is said below them."""
    rows = [
        (finding["kind"], _sentence(finding), finding["remedy"], _floors(finding)) for finding in document["findings"]
    ]
    below = list(document["remarks"])
    if not rows:
        return Table(HEADLINES[document["verdict"]], ("", ""), [("audit", document["summary"])], "\n".join(below))
    below.append("Mend this first: a diagnosis would take it for physics.")
    columns = ("kind", "what is wrong", "what to do", "gap / noise")
    return Table(HEADLINES[document["verdict"]], columns, rows, "\n".join(below))


def _sentence(finding: Mapping[str, Any]) -> str:
    return " Or: ".join([finding["sentence"], *finding["or"]])


def _floors(finding: Mapping[str, Any]) -> str:
    if finding["before"] is None:
        return ""
    return f"{finding['before']:.1f} -> {finding['after']:.1f}"
