"""Building a gymnasium environment from its id, or from a class, and what is wrong with one that cannot be built."""

from __future__ import annotations

import importlib
import importlib.util
import logging
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium

from gsl.core.loaded import note
from gsl.core.own_code import is_elsewhere
from gsl.errors import ConfigError
from gsl.worlds.mujoco import without_remarks

_log = logging.getLogger("gsl")


def make_environment(name: str, kwargs: Mapping[str, Any]) -> gymnasium.Env:
    """Return a registered environment, or an instance of an importable class.

    Raises:
        ConfigError: It does not exist, cannot be imported, or refuses its arguments.
    """
    make = _maker(name)
    try:
        with without_remarks(), _without_gymnasiums_warnings():
            env = make(**kwargs)
    except gymnasium.error.DependencyNotInstalled as error:
        needs = "needs MuJoCo: pip install 'gsl[mujoco]'" if "mujoco" in str(error).lower() else line(error)
        raise ConfigError("env_id", needs, given=name) from error
    except gymnasium.error.Error as error:
        hint = "" if ":" in name else "; one that a module of yours registers is module:id"
        raise ConfigError("env_id", f"there is no such environment: {line(error)}{hint}", given=name) from error
    except Exception as error:
        problem = f"cannot be made: {type(error).__name__}: {line(error)}"
        if not kwargs:
            raise ConfigError("env_id", problem, given=name) from error
        raise ConfigError("kwargs", f"{name} {problem}", given=str(dict(kwargs))) from error
    if not isinstance(env, gymnasium.Env):
        raise ConfigError("env_id", "is no gymnasium.Env", given=name)
    if env.spec and env.spec.id not in name:
        _log.info("%s is %s", name, env.spec.id)
    for lacking in ("observation_space", "action_space"):
        if not isinstance(getattr(env, lacking, None), gymnasium.Space):
            raise ConfigError("env_id", f"has no {lacking}", given=name)
    return env


def _maker(name: str) -> Callable[..., Any]:
    place, separator, attribute = name.partition(":")
    if not separator or not attribute.isidentifier():
        with suppress(Exception), _without_gymnasiums_warnings():  # what is wrong with it, gymnasium will tell
            importlib.import_module(str(gymnasium.spec(name).entry_point).partition(":")[0])
        return partial(gymnasium.make, name, disable_env_checker=True)
    try:
        module = importlib.import_module(place)
    except Exception as error:
        absent = isinstance(error, ModuleNotFoundError) and error.name and f"{place}.".startswith(f"{error.name}.")
        problem = "there is no such environment" if absent else "its module cannot be imported"
        raise ConfigError("env_id", f"{problem}: {type(error).__name__}: {line(error)}", given=name) from error
    note(place)
    if not hasattr(module, attribute):
        raise ConfigError("env_id", f"there is no such environment: {place} has no {attribute}", given=name)
    return getattr(module, attribute)


def own_module(name: str) -> Path | None:
    """Return the file of the module in `module:Class`; None of what is installed, or is gsl's own."""
    module, separator, _ = name.partition(":")
    spec = None
    with suppress(Exception):  # what is wrong with a package around it, `made` tells
        spec = importlib.util.find_spec(module) if separator else None
    if spec is None or not spec.has_location or spec.origin is None:
        return None
    path = Path(spec.origin)
    return path if is_elsewhere(str(path)) else None


def own_code(name: str) -> Any:
    """Return the class or function in `module:Class` of a user's own, if it is loaded."""
    module, _, word = name.partition(":")
    code = getattr(sys.modules.get(module), word, None) if own_module(name) else None
    home = sys.modules.get(getattr(code, "__module__", ""))
    return code if getattr(home, getattr(code, "__qualname__", ""), None) is code else None  # or nobody finds it


@contextmanager
def _without_gymnasiums_warnings() -> Iterator[None]:
    """Have gymnasium say nothing of a registered id; it would with every environment that is made."""
    before = gymnasium.logger.min_level
    gymnasium.logger.min_level = gymnasium.logger.ERROR
    try:
        yield
    finally:
        gymnasium.logger.min_level = before


def line(error: object) -> str:
    """Return what something says as one line."""
    return " ".join(str(error).split()).rstrip(".")
