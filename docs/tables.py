"""Writes the tables of these pages that say what classes declare: `python docs/tables.py`; a test keeps them so.

A table stands between <!-- table NAME --> and <!-- end -->, on any page.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from gsl.core.servo import numbers
from gsl.core.setting import Setting, settings_of
from gsl.effects.effect import KINDS, effect_class, names

HERE = Path(__file__).parent
PLACE = re.compile(r"(<!-- table (\w+) -->\n).*?(?=<!-- end -->)", re.DOTALL)


def effects() -> Iterator[Sequence[str]]:
    """Yield the effects of the library in the order in which they are applied."""
    yield (
        "effect",
        "parameters, documented range",
        "what it is",
        "signature",
        "confused with, and separated by",
    )
    classes = {name: effect_class(name) for name in names()}
    for name, kind in sorted(classes.items(), key=lambda one: (KINDS.index(one[1].kind), one[1].rank)):
        told = " ".join((kind.__doc__ or "").split()).partition("Signature: ")[2]
        signature, _, confused = told.partition(" Confused with ")
        parameters = [describe(each) for each in settings_of(kind).values() if each.name != "joints"]
        meaning = (importlib.import_module(kind.__module__).__doc__ or "").strip().rstrip(".")
        yield f"`{name}`", "; ".join(parameters), meaning, signature.rstrip("."), confused.rstrip(".")


def describe(parameter: Setting) -> str:
    """Return a parameter with its unit and its documented range."""
    text = f"`{parameter.name}`{f' {parameter.unit}' if parameter.unit else ''}"
    return text if parameter.lower is None else f"{text}, {parameter.lower:g} to {parameter.upper:g}"


def servo() -> Iterator[Sequence[str]]:
    """Yield the numbers of a servo."""
    yield "number", "unit", "meaning", "does nothing at"
    for name, number in numbers().items():
        yield f"`{name}`", number.unit, number.meaning, f"{number.inert:g}"


TABLES: dict[str, Callable[[], Iterator[Sequence[str]]]] = {"effects": effects, "numbers": servo}


def tabulate(rows: Iterator[Sequence[str]]) -> str:
    """Return rows, the first of which are titles, in markdown."""
    titles, *cells = ([cell.replace("|", "\\|") for cell in row] for row in rows)
    return "".join(f"| {' | '.join(row)} |\n" for row in (titles, ["---"] * len(titles), *cells))


def fill(page: str) -> str:
    """Return a page with its tables as the classes have them now."""
    return PLACE.sub(lambda found: found[1] + tabulate(TABLES[found[2]]()), page)


def write(folder: Path = HERE) -> None:
    """Fill the tables of all pages."""
    for path in folder.rglob("*.md"):
        page = path.read_text(encoding="utf-8")
        if (filled := fill(page)) != page:
            path.write_text(filled, encoding="utf-8")


if __name__ == "__main__":
    write()
