"""How large settings get with what they refer to written out: references that double would take hours."""

from __future__ import annotations

import re
from typing import Any

from gsl.errors import InputError

MOST = 1_000_000
"""Characters, each value counted as `VALUE` of them; the largest of our configurations has 24,000."""
VALUE = 50
_REFERENCE = re.compile(r"\$\{([^${}:]+)\}")  # to a setting; what has a colon calls a resolver
_HOPS = 100  # from reference to reference, after which they are taken to go round

Path = tuple[str, ...]


def check_expansion(tree: Any) -> None:
    """Refuse settings whose references multiply, before they are resolved.

    Raises:
        InputError: They would get too large.
    """
    if (size := _Sizes(tree).of(())) > MOST:
        raise InputError(f"settings refer to each other so often that they get too large ({size:.1e} characters)")


class _Sizes:
    def __init__(self, tree: Any) -> None:
        self._tree = tree
        self._known: dict[Path, int] = {}

    def of(self, path: Path) -> int:
        """Return the size of what is at a path; 0 where there is nothing, or only references that go round."""
        settled = self._settle(path)
        if settled is None:
            return 0
        path, node = settled
        if path not in self._known:
            self._known[path] = 0  # within itself
            self._known[path] = VALUE + self._inside(path, node)
        return self._known[path]

    def _inside(self, path: Path, node: Any) -> int:
        if isinstance(node, dict | list):
            return sum(self.of((*path, str(key))) for key in (node if isinstance(node, dict) else range(len(node))))
        if isinstance(node, str):
            return len(node) + sum(self.of(_target(path, name)) for name in _REFERENCE.findall(node))
        return 0

    def _settle(self, path: Path) -> tuple[Path, Any] | None:
        """Return where a path leads through references, and what is there."""
        for _ in range(_HOPS):
            node = self._tree
            for index, key in enumerate(path):
                if isinstance(node, str) and (reference := _REFERENCE.fullmatch(node)):
                    path = (*_target(path[:index], reference[1]), *path[index:])
                    break
                node = _entry(node, key)
            else:
                return None if node is None else (path, node)
        return None


def _entry(node: Any, key: str) -> Any:
    if isinstance(node, list):
        return node[int(key)] if key.isdecimal() and int(key) < len(node) else None
    if not isinstance(node, dict):
        return None
    return node[key] if key in node else next((value for name, value in node.items() if str(name) == key), None)


def _target(path: Path, name: str) -> Path:
    """Return the path of what is named at a path: `.a` is beside it, `..a` beside what holds it."""
    dots = len(name) - len(name.lstrip("."))
    words = [word for word in re.split(r"[.\[\]]", name.strip()) if word]
    return (*(path[: max(0, len(path) - dots)] if dots else ()), *words)
