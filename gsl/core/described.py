"""A component as plain data again: what a configuration file would say to build it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any


def described(thing: Any) -> Any:
    """Return a component's settings with its class under `_target_`, its components likewise; plain data as it is."""
    if is_dataclass(thing) and not isinstance(thing, type):
        kind = type(thing)
        settings = {field.name: described(getattr(thing, field.name)) for field in fields(thing)}
        return {"_target_": f"{kind.__module__}.{kind.__qualname__}", **settings}
    if isinstance(thing, Mapping):
        return {key: described(value) for key, value in thing.items()}
    if isinstance(thing, list | tuple):
        return [described(value) for value in thing]
    return thing
