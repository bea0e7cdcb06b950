"""The files that components read by themselves, such as a world's robot: parents of whatever is made with them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any


def read_files(thing: Any) -> dict[str, Path]:
    """Return the `read_files` of a component and of all components in it, by dotted name of the setting."""
    return dict(_found(thing, ""))


def _found(thing: Any, where: str) -> Iterator[tuple[str, Path]]:
    if isinstance(thing, Mapping):
        parts = {str(key): value for key, value in thing.items()}
    elif isinstance(thing, list | tuple):
        parts = {str(index): value for index, value in enumerate(thing)}
    elif is_dataclass(thing) and not isinstance(thing, type):
        parts = {field.name: getattr(thing, field.name) for field in fields(thing)}
        own: Mapping[str, Path] = getattr(thing, "read_files", {})
        yield from ((f"{where}{name}", path) for name, path in own.items())
    else:
        return
    for name, part in parts.items():
        yield from _found(part, f"{where}{name}.")
