"""Settings as the command line has them: KEY=VALUE in Hydra's grammar."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gsl.commandline.own_word import quote
from gsl.errors import ConfigError

_NAME = re.compile(r"[A-Za-z_][\w/-]*", re.ASCII)  # goes without quotes
_WORDS = ("null", "true", "false", "nan", "inf")  # would be something else without


def overrides(settings: Mapping[str, Any], below: str = "") -> Iterator[str]:
    """Yield settings as KEY=VALUE; a mapping is settings below its key."""
    for key, value in settings.items():
        if isinstance(value, Mapping) and value:
            yield from overrides(value, f"{below}{key}.")
        else:
            yield f"{below}{key}={_text(value)}"


def _text(value: Any) -> str:
    """Return a value in Hydra's grammar of overrides.

    Raises:
        ConfigError: It has no place on a command line.
    """
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_text(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, np.ndarray | np.generic):
        return _text(value.tolist())
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_text, value)) + "]"
    if isinstance(value, str | Path):
        text = str(value)
        plain = _NAME.fullmatch(text) and text.lower() not in _WORDS
        return text if plain else quote(text)
    if value is None or isinstance(value, bool | int | float):
        return json.dumps(value)
    raise ConfigError("settings", "are numbers, texts, lists, mappings or components", given=type(value).__name__)
