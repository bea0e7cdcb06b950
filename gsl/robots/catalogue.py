"""Robots by name: `nao` is what gsl/robots/nao.py calls nao; a user's own is `package.module.function`."""

from __future__ import annotations

import importlib
import pkgutil

from gsl.core.body import Robot
from gsl.core.validation import did_you_mean
from gsl.errors import ConfigError

_NOT_ROBOTS = ("catalogue", "urdf", "nao_legs", "nao_shapes")


def names() -> tuple[str, ...]:
    """Return the names of the robots that come with gsl."""
    package = importlib.import_module("gsl.robots")
    found = (module.name for module in pkgutil.iter_modules(package.__path__))
    return tuple(sorted(set(found) - set(_NOT_ROBOTS)))


def robot(name: str) -> Robot:
    """Build a robot.

    Raises:
        ConfigError: if nothing is called so.
    """
    place, _, function = name.rpartition(".") if "." in name else (f"gsl.robots.{name}", "", name)
    if not (name in names() or "." in name):
        raise ConfigError("robot", f"no robot called '{name}'{did_you_mean(name, names(), listed=True)}")
    try:
        built: Robot = getattr(importlib.import_module(place), function)()
        return built
    except (ImportError, AttributeError) as error:
        raise ConfigError("robot", f"'{name}' cannot be imported: {error}") from error
