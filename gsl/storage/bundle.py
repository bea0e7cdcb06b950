"""The modules that a runner takes along: the source of a policy and all that it imports, unchanged, for numpy alone."""

from __future__ import annotations

import ast
import importlib.util
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from gsl.errors import ConfigError

RUNNER = "gsl.runner.process"
_STAND_INS = {f"gsl.core.{name}": f"gsl.runner.stand_in.{name}" for name in ("setting", "compiled", "validation")}
_STAND_INS["gsl"] = "gsl.runner.stand_in.face"
SOURCES = 256  # that are parsed once a process: a chain asks the robot four times, with some forty modules each
_THERE = {*sys.stdlib_module_names, "numpy"}


def bundle(modules: tuple[str, ...]) -> dict[str, bytes]:
    """Return the sources that some modules need, by path below the bundle.

    Raises:
        ConfigError: One of them needs a library beside numpy.
    """
    files: dict[str, bytes] = {}
    waiting, visited = list(modules), set()
    while waiting:
        name = waiting.pop()
        if name in visited:
            continue
        visited.add(name)
        path = _source(_STAND_INS.get(name, name), modules[-1])
        below = "/__init__.py" if path.name == "__init__.py" or name == "gsl" else ".py"
        files[name.replace(".", "/") + below] = path.read_bytes()
        waiting += [*_find_imports(path, name), *([name.rpartition(".")[0]] if "." in name else [])]
    return dict(sorted(files.items()))


def _find_imports(path: Path, module: str) -> Iterator[str]:
    """Yield the modules that a source imports, those that are there anyway left out."""
    for parent, names in _read_imports(path.read_text(encoding="utf-8")):
        for name in names:
            top = name.partition(".")[0]
            if top in _THERE or not (name == parent or _is_module(name)):
                continue
            if top not in ("gsl", module.partition(".")[0]):
                problem = f"{module} needs {top}, but beside a robot there is numpy alone"
                raise ConfigError("policy", problem)
            yield name


@lru_cache(SOURCES)
def _read_imports(source: str) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Return what a source imports: each module with what may be modules below it."""
    imports: list[tuple[str, tuple[str, ...]]] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            imports += [(alias.name, (alias.name,)) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            imports.append((node.module, (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))))
    return tuple(imports)


def _is_module(name: str) -> bool:
    top = name.partition(".")[0]
    if top in _THERE:
        return False
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def _source(module: str, wanted: str) -> Path:
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        raise ConfigError("policy", f"{wanted} needs {module}, which has no Python source to take along")
    return Path(spec.origin)
