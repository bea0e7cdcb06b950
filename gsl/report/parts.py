"""Parts of a page as markup: tables, sections, lists and pictures, each a macro of templates/parts.html."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from markupsafe import Markup, escape

if TYPE_CHECKING:
    import jinja2

Part = str | None
"""Text, which is escaped, markup, or nothing."""

_UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\u202a-\u202e\u2066-\u2069]")
_CODE = re.compile(r"`([^`]+)`")
_BEFORE_UNIT = re.compile(r"(?<=\d) (?=[%×]|(?:ms|s|kg|N·m|cm/s)\b)")


@functools.cache
def environment() -> jinja2.Environment:
    """Return the environment of our templates: all that is not markup already is shown as text."""
    import jinja2

    return jinja2.Environment(
        loader=jinja2.PackageLoader("gsl.report"),
        autoescape=True,
        finalize=_finalize,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def clean(text: str) -> str:
    """Return text with � for marks that no reader sees, or that turn the text round."""
    return _UNPRINTABLE.sub("\ufffd", text)


def _finalize(value: object) -> object:
    """Return what a template shows: nothing for None."""
    if isinstance(value, Markup):
        return Markup(clean(value))
    return "" if value is None else clean(value) if isinstance(value, str) else value


def render(template: str, **values: object) -> Markup:
    """Return a template filled in."""
    return Markup(environment().get_template(template).render(**values))


def _fill(macro: str, *arguments: object) -> Markup:
    """Return a macro of parts.html filled in."""
    return Markup(getattr(environment().get_template("parts.html").module, macro)(*arguments))


def prose(text: str) -> Markup:
    """Return a sentence as markup: what stands in `backticks` is code, and numbers keep their units in one line."""
    return Markup(_CODE.sub(r"<code>\1</code>", str(escape(_BEFORE_UNIT.sub("\u00a0", text)))))


def join(*parts: Part) -> Markup:
    """Return parts one after the other."""
    return Markup("").join(part for part in parts if part is not None)


def element(tag: str, *parts: Part, kind: str = "", style: str = "") -> Markup:
    """Return an element with its class and style, if it has any."""
    return _fill("element", tag, join(*parts), kind, style)


def table(columns: Sequence[Part], rows: Sequence[Sequence[Part]], *, kind: str = "", caption: Part = None) -> Markup:
    """Return a table that scrolls sideways where it is too wide; the first cell of a row is its heading.

    A column without a value in any row is left out.

    Args:
        columns: Headings.
        rows: Cells; a cell that is a `<td>` already stays as it is.
        kind: Class of the table.
        caption: Said below it.
    """
    empty = {k for k in range(len(columns)) if rows and not any(any(row[k : k + 1]) for row in rows)}
    lines = [[cell for k, cell in enumerate(line) if k not in empty] for line in (columns, *rows)]
    return _fill("table", lines[0], lines[1:], kind, caption)


def section(title: str, *parts: Part, note: str = "") -> Markup | None:
    """Return a part of the page with its heading and how to read it, nothing if there is nothing in it."""
    present = [part for part in parts if part]
    return _fill("section", title, present, note) if present else None


def bullets(lines: Sequence[Part]) -> Markup | None:
    """Return a list, nothing if it is empty."""
    return _fill("bullets", lines) if lines else None


def facts(pairs: Sequence[tuple[str, Part]]) -> Markup | None:
    """Return names with what they are, but for those that are nothing."""
    present = [(name, value) for name, value in pairs if value]
    return _fill("facts", present) if present else None


def command(lines: str) -> Markup | None:
    """Return what is to be typed, a command a line."""
    return _fill("command", lines.splitlines()) if lines else None


def fold(title: str, *parts: Part) -> Markup:
    """Return parts that are shown when their title is chosen."""
    return _fill("folded", title, join(*parts))


def choice(label: str, pictures: Mapping[str, Markup]) -> Markup | None:
    """Return pictures of which the reader chooses the one that is shown, the first to begin with; without script all.

    Args:
        label: What is chosen.
        pictures: By name.
    """
    return _fill("choice", label, pictures) if pictures else None
