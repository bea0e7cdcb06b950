"""A page as a browser would understand it."""

from __future__ import annotations

import re
from collections import Counter
from html.parser import HTMLParser

VOID = {"meta"}


class Page(HTMLParser):
    """What a page holds: its tags, their attributes, and the text that a reader sees."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: Counter[str] = Counter()
        self.attributes: list[tuple[str, str, str]] = []
        self.text, self.script = "", ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        self.attributes += [(tag, key, value or "") for key, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "script":
            self.script += data
        elif self.open and self.open[-1] != "style":
            self.text += data + " "

    def classes(self) -> Counter[str]:
        return Counter(word for _, key, value in self.attributes if key == "class" for word in value.split())


def words(text: str) -> str:
    """Text of a page with single plain spaces."""
    return " ".join(Page(text).text.split())


def check_alone(text: str) -> None:
    """Fail if a page asks for anything outside of itself."""
    page = Page(text)
    assert page.tags["link"] == page.tags["img"] == 0
    assert not [
        attribute for attribute in page.attributes if attribute[1] in ("src", "srcset") or attribute[1].startswith("on")
    ]
    assert all(
        attribute[2].startswith("#") for attribute in page.attributes if attribute[1] == "href"
    )  # a mark that is drawn twice
    assert "http" not in text.replace("http-equiv", "") and "@import" not in text
    assert re.search(r"url\((?!#)", text) is None
