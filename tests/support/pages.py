"""The pages for readers, README.md and docs/, taken apart: sentences, links, anchors, and commands."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
RESULTS = sorted((ROOT / "docs/results").rglob("*.md"))  # figures with their own tests
GUIDES = [ROOT / "README.md", *(page for page in sorted((ROOT / "docs").rglob("*.md")) if page not in RESULTS)]
WRITTEN = [*GUIDES, *(page for page in RESULTS if page.parent.name == "results")]  # below it, studies write tables

FENCE = re.compile(r"^( *)```(\w*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
ITEM = re.compile(r"^\s*([-*]|\d+\.) ")
LINK = re.compile(r"!?\[([^\]]*)\]\(([^)\s]+)\)")
# A sentence ends before a capital letter, a code word, or a name of the paper's.
END = re.compile(r"(?<=[.!?])[\"')*]*\s+(?=[A-Zπf*\"'(\[]|CODE)")
SHELLS = ("bash", "console", "sh", "shell")
PROGRAMS = ("gsl", "make", "pip", "python", "source", "jq")
# The shell takes a line apart; its programs are functions that write their words down, each command on a line.
RECORD = "\n".join(
    f'{name}() {{ local words; printf -v words \'%s\\x1f\' {name} "$@"; echo "$words" >&3; }}' for name in PROGRAMS
)  # in one piece, for the programs of a pipe write side by side


def without_code(text: str) -> str:
    """A page without its blocks of code; a paragraph that is indented by four blanks is one, too."""
    return re.sub(r"(?<=\n\n)(?: {4}[^\n-].*\n)+", "", FENCE.sub("", text))


def prose(text: str) -> Iterator[str]:
    """The paragraphs and list items of a page, without headings, tables and pictures."""
    part: list[str] = []
    for line in [*without_code(text).splitlines(), ""]:
        apart = not line.strip() or line.startswith(("#", "|", "!["))
        if (apart or ITEM.match(line)) and part:
            yield " ".join(part)
            part = []
        if not apart:
            part.append(ITEM.sub("", line, count=1).strip())


def sentences(text: str) -> Iterator[str]:
    """The sentences of a page; a piece of code counts as a word, a link as its text."""
    for paragraph in prose(text):
        plain = re.sub(r"`[^`]*`", "CODE", LINK.sub(r"\1", paragraph))
        yield from filter(words, END.split(plain))


def words(sentence: str) -> list[str]:
    return [word for word in sentence.split() if re.search(r"\w", word)]


def anchors(text: str) -> set[str]:
    """The anchors of a page's headings, as the repository and the site make them."""
    titles = re.findall(r"^#+ (.+)$", without_code(text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", LINK.sub(r"\1", title).lower()).strip().replace(" ", "-") for title in titles}


class Command(NamedTuple):
    """A command as a page prints it: where, which line, and its words as the program gets them."""

    page: str
    line: str
    words: tuple[str, ...]


def commands(page: Path) -> Iterator[Command]:
    """The commands of a page's shell blocks. What is no known program fails here, so that nothing is passed over."""
    for _, language, block in FENCE.findall(page.read_text("utf-8")):
        if language not in SHELLS:
            continue
        for line in re.sub(r"\\\n\s*", "", block).splitlines():
            typed = line.strip().removeprefix("$ ")
            if not typed or typed.startswith("#"):
                continue
            script = f"{RECORD}\ncd() {{ :; }}\n{typed}"
            result = subprocess.run(
                ["bash", "-euo", "pipefail", "-c", f"exec 3>&1 1>/dev/null; {script}"], capture_output=True, text=True
            )
            assert result.returncode == 0, f"{page.name}: {typed}: {result.stderr}"
            for record in result.stdout.splitlines():
                yield Command(page.relative_to(ROOT).as_posix(), typed, tuple(record.split("\x1f")[:-1]))
