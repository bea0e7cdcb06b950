"""Robots of the package robot_descriptions by name, where its files are on disk: nothing is imported or downloaded.

    world.robot=robot_descriptions:panda_description

Each robot is a module of that package; importing it would clone a repository. So its text is read instead:

    REPOSITORY_PATH = _clone_to_cache("example-robot-data", ...)
    URDF_PATH = _path.join(REPOSITORY_PATH, "robots", "panda.urdf")

Repositories are where the package keeps them: in $ROBOT_DESCRIPTIONS_CACHE or ~/.cache/robot_descriptions.
"""

from __future__ import annotations

import ast
import importlib.util
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from gsl.core.budget import read_text
from gsl.core.validation import did_you_mean
from gsl.errors import InputError

PREFIX = "robot_descriptions:"
_CACHE, _USUAL_CACHE = "ROBOT_DESCRIPTIONS_CACHE", "~/.cache/robot_descriptions"
_ENDING, _URDF = "_description", "URDF_PATH"


def find_description(name: str) -> Path:
    """Return the URDF of a robot.

    Args:
        name: With its prefix; the ending _description may be left out.

    Raises:
        InputError: The package is not installed, has no such robot, or its files are not on disk.
    """
    package, word = _package(), name.removeprefix(PREFIX)
    modules = sorted(file.stem for file in package.glob(f"*{_ENDING}.py"))
    module = word if word in modules else f"{word}{_ENDING}"
    if module not in modules:
        raise InputError(f"{name}: the package has no such robot{did_you_mean(module, modules)}")
    caches = dict(_read_repositories(package / "_repositories.py"))
    paths = _read_paths(package / f"{module}.py", caches)
    if _URDF not in paths:
        raise InputError(f"{name}: says no file that is a URDF; write one from what it has, and name that")
    if not paths[_URDF].is_file():
        advice = f"robot_descriptions pull {module} brings it"
        raise InputError(f"{name}: is not on disk ({paths[_URDF]}), and gsl downloads nothing; {advice}")
    return paths[_URDF]


def _package() -> Path:
    spec = importlib.util.find_spec(PREFIX.rstrip(":"))
    if spec is None or not spec.submodule_search_locations:
        raise InputError(f"{PREFIX} needs the package: pip install robot_descriptions; or name a URDF file")
    return Path(next(iter(spec.submodule_search_locations)))


def _read_repositories(file: Path) -> Iterator[tuple[str, Path]]:
    """Yield the repositories that the package knows and where it keeps them."""
    home = Path(os.environ.get(_CACHE) or _USUAL_CACHE).expanduser()
    for node in ast.walk(_parse(file)):
        for key, value in zip(node.keys, node.values, strict=True) if isinstance(node, ast.Dict) else ():
            if isinstance(key, ast.Constant) and isinstance(value, ast.Call):
                for word in value.keywords:
                    if word.arg == "cache_path" and isinstance(word.value, ast.Constant):
                        yield str(key.value), home / str(word.value.value)


def _read_paths(file: Path, repositories: Mapping[str, Path]) -> dict[str, Path]:
    """Return the paths that a module names, as far as they are put together of texts."""
    paths: dict[str, Path] = {}
    for node in _parse(file).body:
        target = (
            node.target
            if isinstance(node, ast.AnnAssign)
            else node.targets[0]
            if isinstance(node, ast.Assign)
            else None
        )
        if isinstance(target, ast.Name) and isinstance(node, ast.Assign | ast.AnnAssign):
            path = _evaluate(node.value, paths, repositories)
            if path is not None:
                paths[target.id] = path
    return paths


def _evaluate(node: ast.expr | None, paths: Mapping[str, Path], repositories: Mapping[str, Path]) -> Path | None:
    """Return the path that an expression is, None if it is another."""
    if isinstance(node, ast.Name):
        return paths.get(node.id)
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return Path(node.value)
    if not isinstance(node, ast.Call) or not node.args:
        return None
    called = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
    parts = [_evaluate(argument, paths, repositories) for argument in node.args]
    if called.endswith("clone_to_cache"):
        return repositories.get(str(parts[0]))
    whole = [part for part in parts if part is not None]
    return Path(*whole) if called == "join" and len(whole) == len(parts) else None


def _parse(file: Path) -> ast.Module:
    try:
        return ast.parse(read_text(file))
    except (SyntaxError, ValueError) as error:
        raise InputError(f"{file}: is not the package that gsl knows how to read: {error}") from error
