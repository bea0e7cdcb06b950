"""What can be set in a configuration: the keys of its yaml files and the settings its classes declare."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from omegaconf import DictConfig, OmegaConf

from gsl.commandline.overrides import COMMAND_KEYS
from gsl.core.setting import Setting, parts_of, settings_of
from gsl.core.trust import TARGET, class_of
from gsl.errors import ConfigError

REFERRED_GROUPS = ("preset", "recipe")  # values without a class, to which settings refer
REFERRED = tuple(f"{group}." for group in REFERRED_GROUPS)


def is_idle(key: str, text: str) -> bool:
    """Whether a key is of a recipe or a preset, and no setting of a configuration, as a text, refers to it."""
    return key.startswith(REFERRED) and not re.search(rf"\$\{{[^}}]*\b{re.escape(key)}\b", text)


def list_keys(config: DictConfig) -> list[str]:
    """Return every dotted key that can be set, those of the command included."""
    return sorted({*COMMAND_KEYS, *_keys_below(config, "")})


def read_declared(node: Mapping[str, Any]) -> Mapping[str, Setting]:
    """Return the settings of the class that a checked mapping names with `_target_`, nothing if it names none."""
    name = node.get(TARGET)
    try:
        return settings_of(class_of(name)) if isinstance(name, str) else {}
    except (ConfigError, ValueError, TypeError, AttributeError):
        return {}


def read_parts(node: Mapping[str, Any]) -> Mapping[str, Mapping[str, Setting]]:
    """Return the settings of those fields that are components and need no `_target_`, such as a mapping's `time`."""
    name = node.get(TARGET)
    try:
        kinds = parts_of(class_of(name)) if isinstance(name, str) else {}
    except (ConfigError, ValueError, TypeError, AttributeError):
        return {}
    return {field: settings_of(kind) for field, kind in kinds.items()}


def plain(config: Any) -> dict[str, Any]:
    """Return a configuration as it is written, references and missing values as text; of a single value, nothing."""
    container = OmegaConf.to_container(config, resolve=False) if isinstance(config, DictConfig) else None
    return {str(key): value for key, value in container.items()} if isinstance(container, dict) else {}


def _keys_below(node: DictConfig, path: str) -> Iterator[str]:
    parts = read_parts(plain(node))
    for key in {*read_declared(plain(node)), *map(str, node)}:
        yield f"{path}{key}"
        yield from (f"{path}{key}.{name}" for name in parts.get(key, ()))
        below = None if OmegaConf.is_missing(node, key) or OmegaConf.is_interpolation(node, key) else node.get(key)
        if isinstance(below, DictConfig):
            yield from _keys_below(below, f"{path}{key}.")
