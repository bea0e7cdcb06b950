"""Words that people read are plain: in messages, help, pages and plots."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

PLOT = Path(__file__).parents[2]
PLACES = [path for room in ("gsl", "experiments", "benchmarks") for path in sorted((PLOT / room).rglob("*.py"))]
BANNED = re.compile(r"\b(?:surely|told)\b|\b[Ii]n real\b(?!=| (?:episodes|trajectories|world))|(?<![\w.\])*:%])\.\d")


def sentences(path: Path) -> list[str]:
    """The text of a module that is neither a docstring nor a single word; what an f-string fills in is `{}`."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    skipped = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    texts = list[str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            skipped.update(id(part) for part in node.values)
            skipped.update(id(part.format_spec) for part in node.values if isinstance(part, ast.FormattedValue))
            text = "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values)
        else:
            text = node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""
        if id(node) not in skipped and " " in text.strip():
            texts.append(text)
    return texts


@pytest.mark.parametrize("text", ["it is surely so", "falls in real now", "a value of .9", "it was told so"])
def test_the_pattern_sees_what_it_is_for(text: str) -> None:
    assert BANNED.search(text)


def test_no_message_page_or_help_has_words_that_nobody_says() -> None:
    wrong = {path.relative_to(PLOT).as_posix(): words for path in PLACES
             if (words := [text for text in sentences(path) if BANNED.search(text)])}  # fmt: skip
    assert wrong == {}
