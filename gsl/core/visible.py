"""Text as a terminal may show it: what would steer the terminal, or turn the order of letters, is spelled out."""

from __future__ import annotations

import re

_STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff]")


def visible(text: str) -> str:
    """Return a text in which only line ends and tabs are left of control characters; others are spelled as in JSON.

    What was JSON is JSON afterwards, and says the same.
    """
    return _STEERING.sub(lambda match: f"\\u{ord(match[0]):04x}", text)
