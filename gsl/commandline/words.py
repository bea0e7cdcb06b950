"""Words that are typed after a reference: `name=value`, and times such as `7d`."""

from __future__ import annotations

import re
from collections.abc import Sequence

from gsl.errors import ConfigError

_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "w": 604800.0}
_SPAN = re.compile(r"(\d+(?:\.\d+)?)\s*(s|min|h|d|w)")


def split_words(words: Sequence[str], command: str) -> dict[str, str]:
    """Return typed settings by name.

    Raises:
        ConfigError: A word is no setting, or a name comes twice.
    """
    values: dict[str, str] = {}
    for word in words:
        name, sign, value = word.partition("=")
        if not sign or not name:
            raise ConfigError(word, f"is no setting; settings of gsl {command} are typed as name=value")
        if name in values:
            raise ConfigError(name, "is typed twice")
        values[name] = value
    return values


def read_span(name: str, text: str) -> float:
    """Return a time such as `90s`, `30min`, `12h`, `7d` or `2w` [s].

    Raises:
        ConfigError: It is none.
    """
    span = _SPAN.fullmatch(text.strip())
    if span is None:
        raise ConfigError(name, "must be a time such as 90s, 30min, 12h, 7d or 2w", given=text)
    return float(span[1]) * _SECONDS[span[2]]
