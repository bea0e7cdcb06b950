"""Which code a file may name: components of gsl, and the modules that the user himself has named.

A word on the command line is the user's own. What stands in a file is not: it may name a component of gsl, or a class
of a module that `trust=` names. Whatever builds objects from plain data asks here before anything is imported.
"""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import is_dataclass
from typing import Any

from gsl.core.loaded import note
from gsl.errors import ConfigError

TARGET, TRUST = "_target_", "trust"
ROBOT_FILES = (".urdf", ".xacro", ".xml", ".yaml", ".yml")
"""Ends of a robot's name that make it a file."""

_PACKAGES = ("gsl_benchmarks", "gsl_experiments")  # of gsl, beside it
_ROOMS = (
    *("effects", "grounding", "models", "optimizers", "policies", "robots", "stages", "storage.importers", "tasks"),
    *("validation", "worlds", "studies", "blind"),
)
_OURS = (*_PACKAGES, *(f"gsl.{room}" for room in _ROOMS))
_MISSING = "???"  # OmegaConf's word for a setting without a value, as it is until the command line is read
_LABELS = "gsl.storage.importers."  # a mapping's `robot` says whose log it is, and builds none
_NAME = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)+")


def _of_class(name: str) -> str:
    return name.rpartition(".")[0]


def _of_robot(name: str) -> str:
    return "" if "/" in name or name.lower().endswith(ROBOT_FILES) else name.rpartition(".")[0]


def _of_environment(name: str) -> str:
    return name.partition(":")[0] if ":" in name else ""


_MODULE: Mapping[str, Callable[[str], str]] = {
    TARGET: _of_class, "robot": _of_robot, "env_id": _of_environment, "function": _of_environment,
}  # fmt: skip
"""Settings that name code, and the module in such a name; an empty one imports nothing."""
_PICKLES: Mapping[str, str] = {"gsl.policies.sb3.Sb3Policy": "stable_baselines3"}
"""Components whose files hold pickles, which run code as they are read, and the library that has to be trusted."""


def code_in(plain: Any, where: str = "") -> Iterator[tuple[str, str, str]]:
    """Yield where plain data names code that is not gsl's: its dotted path, the name, and the module of it."""
    if isinstance(plain, Mapping):
        entries = [(str(key), value) for key, value in plain.items()]
    elif isinstance(plain, list | tuple):
        entries = [(str(index), value) for index, value in enumerate(plain)]
    else:
        return
    if isinstance(plain, Mapping) and (library := _PICKLES.get(str(plain.get(TARGET)))):
        yield f"{where}.file".lstrip("."), str(plain.get("file")), library
    labels = isinstance(plain, Mapping) and str(plain.get(TARGET)).startswith(_LABELS)
    for key, value in entries:
        path = f"{where}.{key}".lstrip(".")
        if key in _MODULE and isinstance(value, str):
            module = _MODULE[key](value)
            if (module or key == TARGET) and not is_ours(module) and not (labels and key == "robot"):
                yield path, value, module
        else:
            yield from code_in(value, path)


def is_ours(module: str) -> bool:
    """Whether components of a module may be named by any file."""
    return _below(module, _OURS)


def modules_in(plain: Any) -> tuple[str, ...]:
    """Return the modules that plain data names and that are not gsl's."""
    return tuple(dict.fromkeys(module for _, _, module in code_in(plain)))


def check_code(plain: Any, trust: Collection[str] = (), where: str = "", *, references: bool = False) -> None:
    """Refuse plain data that names code of others.

    Args:
        plain: What a file says.
        trust: Modules whose code may be named, theirs below them included.
        where: Dotted path of the data, for errors.
        references: Whether a `${...}` stands for something that is checked once it is known.

    Raises:
        ConfigError: It names the setting and what to say to trust it.
    """
    foreign = [mention for mention in code_in(plain, where) if not (references and "${" in mention[1])]
    if refused := [mention for mention in foreign if not _below(mention[2], trust)]:
        path, name, module = refused[0]
        shown = "" if name == _MISSING else name
        if "${" in name:
            raise ConfigError(path, "refers to something else, which this file cannot; write the value", given=shown)
        if module.partition(".")[0] in sys.stdlib_module_names:
            raise ConfigError(path, "is of Python's own library, which can run programs; no file needs it", given=shown)
        needed = [word for word in trust if any(_below(other, [word]) for _, _, other in foreign)]
        wanted = dict.fromkeys(filter(None, [*needed, *(other for _, _, other in refused)]))
        how = f"{TRUST}={next(iter(wanted), '')}" if len(wanted) < 2 else f"'{TRUST}=[{','.join(wanted)}]'"
        raise ConfigError(path, f"is code that is not gsl's; say {how} if you know where it comes from", given=shown)


def class_of(name: Any, where: str = "") -> Any:
    """Import a class whose name has been checked.

    Raises:
        ConfigError: It is not there, or is no class; one of gsl has to be a component, too.
    """
    place, _, attribute = str(name).rpartition(".")
    setting = f"{where}.{TARGET}".lstrip(".")
    if not _NAME.fullmatch(str(name)):
        raise ConfigError(setting, "is no name of a class, which is module.Class", given=str(name))
    try:
        module = importlib.import_module(place)
    except (Exception, SystemExit) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        if isinstance(error, ModuleNotFoundError) and error.name == place.partition(".")[0]:
            reason = f"there is no module {error.name} in this folder or on Python's path"
        raise ConfigError(setting, f"cannot be loaded: {reason}", given=str(name)) from error
    if not is_ours(place):
        note(place)
    target = getattr(module, attribute, None)
    if not isinstance(target, type):
        raise ConfigError(setting, f"cannot be loaded: {place} has no class {attribute}", given=str(name))
    if is_ours(place) and not (is_dataclass(target) and is_ours(target.__module__)):
        raise ConfigError(setting, "is no component of gsl", given=str(name))
    return target


def _below(module: str, places: Collection[str]) -> bool:
    return any(f"{module}.".startswith(f"{place}.") for place in places)
