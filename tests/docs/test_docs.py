"""README.md and docs/ as a reader meets them: short sentences, plain words, figures in tables, no dead link."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest
from pages import FENCE, GUIDES, LINK, RESULTS, ROOT, SHELLS, WRITTEN, anchors, sentences, words

MOST = 13_500  # words of prose on all pages; whoever needs more first looks for what can go (count_words.py)
LONGEST = 25  # words of a sentence
FIGURES = 2  # numbers in a sentence; more belong in a table
NUMBER = re.compile(r"(?<![\w.-])-?\d[\d.,]*")
LINKED = [*GUIDES, *RESULTS, ROOT / "CHANGELOG.md", *sorted((ROOT / "data").rglob("*.md"))]


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def test_the_pages_together_stay_short() -> None:
    """Without tables, code and headings, and without the tables that studies write."""
    assert sum(len(words(line)) for page in WRITTEN for line in sentences(page.read_text("utf-8"))) <= MOST


def test_prose_has_no_mark_of_an_item_and_no_table_in_it() -> None:
    text = "# A title\n\nOne **word** and\na link to π0. [Two](x.md)\nwords.\n\n| a | b |\n\n- An item - with `a b`.\n"
    assert list(sentences(text)) == ["One **word** and a link to π0.", "Two words.", "An item - with CODE."]


@pytest.mark.parametrize("page", WRITTEN, ids=name)
def test_a_sentence_is_short(page: Path) -> None:
    assert [line for line in sentences(page.read_text("utf-8")) if len(words(line)) > LONGEST] == []


@pytest.mark.parametrize("page", GUIDES, ids=name)
def test_a_sentence_has_few_figures(page: Path) -> None:
    assert [line for line in sentences(page.read_text("utf-8")) if len(NUMBER.findall(line)) > FIGURES] == []


@pytest.mark.parametrize("page", GUIDES, ids=name)
def test_words_are_plain_and_a_decimal_has_its_zero(page: Path) -> None:
    text = FENCE.sub("", page.read_text("utf-8"))
    assert re.findall(r"\b(?:surely|tells?|told|one's)\b", re.sub(r"`[^`]*`", "", text)) == []
    assert re.findall(r"(?<![\w.`\])])[-+±]?\.\d+", text) == []
    assert "in real " not in re.sub(r"`[^`]*`", "", text)


def test_the_readme_is_a_page_one_reads() -> None:
    text = (ROOT / "README.md").read_text("utf-8")
    assert len(text.splitlines()) <= 150
    assert len([link for link in LINK.finditer(text) if link[0].startswith("!")]) == 3  # a plot, a page and a film


@pytest.mark.parametrize("page", LINKED, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    dead = []
    for _, target in LINK.findall(FENCE.sub("", page.read_text("utf-8"))):
        if target.startswith(("http://", "https://")):
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        if not there.exists() or (anchor and anchor not in anchors(there.read_text("utf-8"))):
            dead.append(target)
    assert dead == []


def test_notebooks_and_messages_name_pages_that_exist() -> None:
    named = re.compile(r"docs/[\w/-]+\.md")
    files = [path for room in ("gsl", "conf", "tests", "examples") for path in (ROOT / room).rglob("*")]
    files = [path for path in files if path.suffix in (".py", ".yaml", ".ipynb")] + [ROOT / "Makefile"]
    dead = {(name(path), page) for path in files for page in named.findall(path.read_text("utf-8"))
            if not (ROOT / page).exists()}  # fmt: skip
    assert dead == set()


def test_the_site_keeps_links_within_docs_alone() -> None:
    hook = runpy.run_path(str(ROOT / ".ci/docs_links.py"))["on_page_markdown"]
    page = SimpleNamespace(file=SimpleNamespace(src_uri="howto/own-robot.md"))
    text = hook("[a](../glossary.md#x) [b](../../gsl/cli.py) [c](own-logs.md) ![d](../images/walk.png)", page=page)
    assert text == "[a](../glossary.md#x) `b` [c](own-logs.md) ![d](../images/walk.png)"


def test_the_index_and_the_site_have_every_page() -> None:
    linked = {target.partition("#")[0] for _, target in LINK.findall((ROOT / "docs/index.md").read_text("utf-8"))}
    site = (ROOT / "mkdocs.yml").read_text("utf-8")
    for page in GUIDES[1:]:
        path = page.relative_to(ROOT / "docs").as_posix()
        assert path == "index.md" or path in linked
        assert f": {path}\n" in site


def test_no_command_hides_in_a_block_that_is_not_tested() -> None:
    for page in GUIDES:
        for _, language, block in FENCE.findall(page.read_text("utf-8")):
            typed = re.findall(r"^(?:\$ .*|(?:gsl|make) \S.*)$", block, re.MULTILINE)
            assert language in SHELLS or typed == [], page.name


def test_a_block_of_data_is_what_it_is_called() -> None:
    for page in GUIDES:
        for _, language, block in FENCE.findall(page.read_text("utf-8")):
            if language == "json":
                json.loads(block)
            if language == "python":
                compile(block, page.name, "exec")
