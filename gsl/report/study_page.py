"""The page of a study: its answer, its pictures, and the tables and sentences of its markdown files."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gsl.report.markdown import read_table
from gsl.report.parts import Part, element, prose, section, table
from gsl.report.run_page import Answer, write_page
from gsl.report.svg import svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_study_page(folder: Path, answer: Answer, files: Sequence[str], pictures: Sequence[Figure]) -> None:
    """Write the page of a study.

    Args:
        folder: Where its files are.
        answer: What comes first.
        files: Names of markdown files, whose tables and sentences are shown.
        pictures: Its figures.
    """
    drawn = section("Pictures", *(svg(picture, "figure of the study") for picture in pictures))
    texts = {Path(name).stem.capitalize(): (folder / name).read_text(encoding="utf-8") for name in files}
    write_page(folder, answer, [drawn, *(section(title, *read_markdown(text)) for title, text in texts.items())])


def read_markdown(text: str) -> Iterator[Part]:
    """Yield the tables and paragraphs of a file that we have written."""
    for kind, lines in itertools.groupby(text.splitlines(), key=lambda line: line[:1] if line[:1] in "|#" else "p"):
        block = list(lines)
        if kind == "|":
            yield table(*read_table(block), kind="words" if len(block[0]) > 400 else "")
        elif kind == "#":
            yield from (element("h3", line.lstrip("# ")) for line in block)
        else:
            paragraphs = "\n".join(block).split("\n\n")
            yield from (
                element("p", prose(" ".join(paragraph.split()))) for paragraph in paragraphs if paragraph.strip()
            )
