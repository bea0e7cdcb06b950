"""Settings to be typed: what a message proposes, spelled so that the shell and Hydra read it as it was meant."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*")
_WORDS = {"true", "false", "null", "nan", "inf"}  # no texts to Hydra
_KEY = re.compile(r"[A-Za-z_][A-Za-z0-9_/\-\\+.$%*@?|()\[\]{}:=, ]*")  # keys have no quotes, but backslashes
_ESCAPED = re.compile(r"[\\()\[\]{}:=,]")


def spell(name: str) -> str:
    """Return a text as a value of Hydra: as it is, or in quotes."""
    if _PLAIN.fullmatch(name) and name.lower() not in _WORDS:
        return name
    return '"' + re.sub(r'(\\*)("|$)', lambda end: 2 * end[1] + ('\\"' if end[2] else ""), name) + '"'


def spell_list(names: Iterable[str]) -> str:
    """Return texts as a list of Hydra."""
    return f"[{','.join(map(spell, names))}]"


def spell_key(name: str) -> str:
    """Return a text as a key of Hydra, empty if none can be written so."""
    if not _KEY.fullmatch(name) or name.endswith(" ") or name.lower() in _WORDS:
        return ""
    return _ESCAPED.sub(lambda mark: f"\\{mark[0]}", name)


def spell_setting(key: str, value: str) -> str:
    """Return a setting as the shell takes it; `value` is spelled already. Brackets alone need no quotes there."""
    return f"{key}={value}" if re.fullmatch(r"\[[\w.,-]*\]", value) else shlex.quote(f"{key}={value}")
