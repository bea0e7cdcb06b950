"""A component as plain data, what a configuration file would say to build it; and the component again."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from gsl.core.trust import TARGET, check_code, class_of
from gsl.core.validation import make
from gsl.errors import ConfigError

_PLAIN = {"builtins", "numpy", "pathlib"}


def describe(thing: Any) -> Any:
    """Return a component's settings with its class under `_target_`, its components likewise; plain data as it is.

    Raises:
        ConfigError: Something is of a class that tells no settings.
    """
    if is_dataclass(thing) and not isinstance(thing, type):
        kind = type(thing)
        settings = {field.name: describe(getattr(thing, field.name)) for field in fields(thing)}
        return {TARGET: f"{kind.__module__}.{kind.__qualname__}", **settings}
    if isinstance(thing, Mapping):
        return {key: describe(value) for key, value in thing.items()}
    if isinstance(thing, list | tuple):
        return [describe(value) for value in thing]
    if type(thing).__module__.partition(".")[0] not in _PLAIN:
        problem = "is no dataclass, so that its settings, which are part of what it makes, cannot be written down"
        raise ConfigError("_target_", f"{problem}; put @dataclass above it", given=type(thing).__qualname__)
    return thing


def restore(plain: Any, *, trust: Collection[str] = (), where: str = "") -> Any:
    """Return what `describe` returned, read from a file, as components again.

    Args:
        plain: Plain data; every mapping with a `_target_` is a component.
        trust: Modules that are not gsl's and whose classes may be imported.
        where: Dotted path of the data, for errors.

    Raises:
        ConfigError: A setting is wrong, or names a class that is not there or may not be imported.
    """
    check_code(plain, trust, where)
    return _build(plain, where)


def _build(plain: Any, where: str) -> Any:
    if isinstance(plain, Mapping):
        settings = {key: _build(value, f"{where}.{key}".lstrip(".")) for key, value in plain.items()}
        if TARGET not in settings:
            return settings
        kind = class_of(settings.pop(TARGET), where)
        try:
            return make(kind, settings)
        except ConfigError as error:
            raise error.under(where) from error
    if isinstance(plain, list | tuple):
        return [_build(value, f"{where}.{index}".lstrip(".")) for index, value in enumerate(plain)]
    return plain
