"""A component as plain data, what a configuration file would say to build it; and the component again."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from gsl.core.validation import make
from gsl.errors import ConfigError

_OURS = "gsl"
_PLAIN = {"builtins", "numpy", "pathlib"}


def described(thing: Any) -> Any:
    """Return a component's settings with its class under `_target_`, its components likewise; plain data as it is.

    Raises:
        ConfigError: Something is of a class that tells no settings.
    """
    if is_dataclass(thing) and not isinstance(thing, type):
        kind = type(thing)
        settings = {field.name: described(getattr(thing, field.name)) for field in fields(thing)}
        return {"_target_": f"{kind.__module__}.{kind.__qualname__}", **settings}
    if isinstance(thing, Mapping):
        return {key: described(value) for key, value in thing.items()}
    if isinstance(thing, list | tuple):
        return [described(value) for value in thing]
    if type(thing).__module__.partition(".")[0] not in _PLAIN:
        problem = "is no dataclass, so that its settings, which are part of what it makes, cannot be written down"
        raise ConfigError("_target_", f"{problem}; put @dataclass above it", given=type(thing).__qualname__)
    return thing


def rebuilt(told: Any, *, trust: bool = False, where: str = "") -> Any:
    """Return what `described` told, read from a file, as components again.

    Args:
        told: Plain data; every mapping with a `_target_` is a component.
        trust: Whether classes that are not gsl's may be imported.
        where: Dotted path of the data, for errors.

    Raises:
        ConfigError: A setting is wrong, or names a class that is not there or may not be imported.
    """
    if isinstance(told, Mapping):
        settings = {key: rebuilt(value, trust=trust, where=f"{where}.{key}".lstrip(".")) for key, value in told.items()}
        if "_target_" not in settings:
            return settings
        return make(class_of(settings.pop("_target_"), trust=trust, where=where), settings, where=where)
    if isinstance(told, list | tuple):
        return [rebuilt(value, trust=trust, where=f"{where}.{index}") for index, value in enumerate(told)]
    return told


def class_of(name: Any, *, trust: bool = False, where: str = "") -> Any:
    """Return the class that data names.

    Args:
        name: Of the class, with its module.
        trust: Whether it may be imported if it is not gsl's.
        where: Dotted path of the data, for errors.

    Raises:
        ConfigError: It is not there, or may not be imported.
    """
    place, _, attribute = str(name).rpartition(".")
    setting = f"{where}._target_".lstrip(".")
    if not trust and place.partition(".")[0] != _OURS:
        problem = "is no class of gsl; trust=true if you know where this file comes from"
        raise ConfigError(setting, problem, given=str(name))
    try:
        found = getattr(importlib.import_module(place), attribute)
    except (ImportError, ValueError, AttributeError) as error:
        raise ConfigError(setting, f"cannot be loaded: {error}", given=str(name)) from error
    if not inspect.isclass(found) or not (trust or found.__module__.partition(".")[0] == _OURS):
        raise ConfigError(setting, "is no class of gsl", given=str(name))
    return found
