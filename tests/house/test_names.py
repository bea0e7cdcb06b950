"""Names say what a thing is: functions are verbs, and no variable is called by a word that fits everything."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

PLOT = Path(__file__).parents[2]
ROOMS = ("gsl", "experiments", "benchmarks", "tests", "examples")
FILLERS = {"one", "found", "told", "known", "given"}
WORD = re.compile(rf"\b({'|'.join(FILLERS)})\b")
IRREGULAR = {
    *("begun", "built", "chosen", "done", "drawn", "driven", "felt", "foreseen", "found", "given", "gone", "grown"),
    *("held", "hidden", "kept", "known", "laid", "lost", "made", "met", "paid", "rebuilt", "said", "seen", "sent"),
    *("shown", "spent", "taken", "thrown", "told", "torn", "won", "worn", "written"),
}
VERBS = {"embed", "exceed", "feed", "need", "proceed", "seed", "speed"}  # that end like participles and are none
PUBLIC = {"grounded_env"}  # `gsl.grounded_env(...)` is written in notebooks of users
CONTRACT = {("gsl/errors.py", "given")}  # an error's attribute, which a user's own component may set


def name_of(path: Path) -> str:
    return path.relative_to(PLOT).as_posix()


def files(*places: str) -> Iterator[Path]:
    for place in places:
        yield from sorted((PLOT / place).rglob("*.py")) or [PLOT / place]


@cache
def look_through(path: Path) -> list[ast.AST]:
    return [*ast.walk(ast.parse(path.read_text(encoding="utf-8")))]


def fillers(path: Path) -> list[str]:
    """Variables and parameters with a filler's name; fields of a class are settings, whose names others type."""
    if not WORD.search(path.read_text(encoding="utf-8")):
        return []
    nodes = look_through(path)
    fields = {id(part.target) for node in nodes if isinstance(node, ast.ClassDef) for part in node.body
              if isinstance(part, ast.AnnAssign)}  # fmt: skip
    bound = [node.arg for node in nodes if isinstance(node, ast.arg)]
    bound += [node.id for node in nodes
              if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and id(node) not in fields]  # fmt: skip
    return [name for name in bound if name in FILLERS and (name_of(path), name) not in CONTRACT]


def participles(path: Path) -> list[str]:
    """Functions that are called by a participle; a property is a value."""
    nodes = look_through(path)
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    verbs = [node.name for node in functions if not any("property" in ast.unparse(d) for d in node.decorator_list)]
    return [name for name in verbs if is_participle(name.strip("_").split("_")[0]) and name not in PUBLIC]


def is_participle(word: str) -> bool:
    return word in IRREGULAR or (word.endswith("ed") and word not in VERBS)


def test_a_variable_says_what_it_is() -> None:
    wrong = {name_of(path): names for path in files(*ROOMS) if (names := fillers(path))}
    assert wrong == {}


def test_a_function_is_a_verb() -> None:
    places = files("gsl", "experiments", "benchmarks")
    wrong = {name_of(path): names for path in places if (names := participles(path))}
    assert wrong == {}
