"""YAML of a file from anywhere as plain data, parsed within a budget: a few lines of aliases can mean gigabytes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from gsl.core.budget import DEPTH, ENTRIES, within
from gsl.errors import InputError


def yaml_tree(path: Path, text: str, most: int = ENTRIES) -> Any:
    """Return what a yaml text says as plain data, once it is known to be small with its aliases written out.

    Args:
        path: For errors.
        text: Of the file.
        most: Entries that it may hold.

    Raises:
        InputError: It is no YAML, nested too deeply, or too large.
    """
    try:
        with within(f"{path}: reading it"):
            node = yaml.compose(text, Loader=yaml.SafeLoader)
            if node is not None:
                _check_size(path, node, most)
            return yaml.safe_load(text)
    except RecursionError as error:
        raise InputError(f"{path}: is nested too deeply; {DEPTH} levels are read") from error
    except (yaml.YAMLError, ValueError, TypeError) as error:
        problem = " ".join(str(error).replace('in "<unicode string>", ', "in ").split())
        raise InputError(f"{path}: is not YAML, or damaged: {problem}") from error


def _check_size(path: Path, root: Any, most: int) -> None:
    """Count entries and levels of a tree of yaml nodes, in which an alias is the same node again."""
    cache: dict[int, tuple[int, int]] = {}
    open_nodes: set[int] = set()

    def size(node: Any) -> tuple[int, int]:
        if id(node) in cache:
            return cache[id(node)]
        if id(node) in open_nodes:
            raise InputError(f"{path}: holds an alias of what it is in; write it out")
        open_nodes.add(id(node))
        value = node.value
        parts = [] if isinstance(value, str) else [child for part in value for child in _nodes(part)]
        sizes = [size(part) for part in parts]
        open_nodes.discard(id(node))
        cache[id(node)] = 1 + sum(count for count, _ in sizes), 1 + max((deep for _, deep in sizes), default=0)
        return cache[id(node)]

    count, depth = size(root)
    if depth > DEPTH:
        raise InputError(f"{path}: is nested {depth} levels deep; {DEPTH} are read")
    if count > most:
        raise InputError(f"{path}: holds {count:,} entries, aliases written out; {most:,} are read")


def _nodes(part: Any) -> tuple[Any, ...]:
    return part if isinstance(part, tuple) else (part,)
