"""HTML that is safe by construction: whatever is not markup already is escaped."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence

_UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\u202a-\u202e\u2066-\u2069]")

_BEFORE_UNIT = re.compile(r"(?<=\d) (?=[%×]|(?:ms|s|kg|N·m)\b)")


class Html(str):
    """Text that is markup already; only this module makes any."""

    __slots__ = ()


Part = str | None
"""Text, which is escaped, markup, or nothing."""


def escape(text: str) -> Html:
    """Return text as markup that shows it; marks that no reader sees, or that turn the text round, are shown as �."""
    return text if isinstance(text, Html) else Html(html.escape(_UNPRINTABLE.sub("\ufffd", text)))


def prose(text: str) -> Html:
    """Return a sentence as markup that keeps numbers and their units in one line; not for what is to be copied."""
    return escape(_BEFORE_UNIT.sub("\u00a0", text))


def join(*parts: Part) -> Html:
    """Return parts one after the other."""
    return Html("".join(escape(part) for part in parts if part is not None))


def element(name: str, *parts: Part, **attributes: str | float | None) -> Html:
    """Return an element.

    Args:
        name: Its tag.
        parts: What is in it; strings that are not markup are escaped.
        attributes: `class_` is class, other underscores are hyphens; those that are None or empty are left out.
    """
    given = {key.rstrip("_").replace("_", "-"): value for key, value in attributes.items() if value not in (None, "")}
    shown = "".join(
        f' {key}="{escape(f"{value:.6g}" if isinstance(value, float) else str(value))}"' for key, value in given.items()
    )
    return Html(f"<{name}{shown}>{join(*parts)}</{name}>")


def table(columns: Sequence[Part], rows: Sequence[Sequence[Part]], *, kind: str = "") -> Html:
    """Return a table that scrolls sideways where it is too wide; the first cell of a row is its heading.

    Args:
        columns: Headings.
        rows: Cells; a cell that is a `<td>` already stays as it is.
        kind: Class of the table.
    """
    head = element("tr", *(element("th", column, scope="col") for column in columns))
    body = [element("tr", element("th", first, scope="row"), *map(_cell, rest)) for first, *rest in rows]
    whole = element("table", element("thead", head), element("tbody", *body), class_=kind)
    return element("div", whole, class_="wide", tabindex="0")


def _cell(part: Part) -> Html:
    return part if isinstance(part, Html) and part.startswith("<td") else element("td", part)


def section(title: str, *parts: Part, note: str = "") -> Html | None:
    """Return a part of the page with its heading and how to read it, nothing if there is nothing in it."""
    present = [part for part in parts if part]
    if not present:
        return None
    return element("section", element("h2", title), element("p", note, class_="note") if note else None, *present)


def bullets(lines: Sequence[Part]) -> Html | None:
    """Return a list, nothing if it is empty."""
    return element("ul", *(element("li", line) for line in lines)) if lines else None
