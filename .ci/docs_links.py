"""A hook of mkdocs: on the site, which has neither sources nor data, links out of docs/ become plain text."""

from __future__ import annotations

import posixpath
import re
from typing import Any

LINK = re.compile(r"(?<!!)\[([^\]]+)\]\((\.\.?/[^)\s]*)\)")


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Return the page with the text of a link in place of a link that leaves docs/."""
    here = posixpath.dirname(page.file.src_uri)

    def kept(link: re.Match[str]) -> str:
        leaves = posixpath.normpath(posixpath.join(here, link[2].partition("#")[0])).startswith("..")
        return f"`{link[1]}`" if leaves else link[0]

    return LINK.sub(kept, markdown)
