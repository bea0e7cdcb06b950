"""Robots by name: `nao` is what gsl/robots/nao.py calls nao; a user's own is a file or `package.module.function`."""

from __future__ import annotations

import importlib
import inspect
import os
import pkgutil
from pathlib import Path

from gsl.core.body import Robot
from gsl.core.trust import is_ours
from gsl.core.validation import did_you_mean
from gsl.errors import ConfigError, InputError
from gsl.robots.descriptions import PREFIX
from gsl.robots.mesh_files import SUFFIXES as MESHES
from gsl.robots.robot_file import SUFFIXES, files_of, from_file, urdf_of

_NOT_ROBOTS = (
    *(
        "catalogue",
        "defaults",
        "descriptions",
        "frames",
        "hinges",
        "joint_limits",
        "mesh_files",
        "meshes",
        "mimic",
        "nao_legs",
    ),
    *("nao_shapes", "robot_file", "so101_published", "so101_shapes", "urdf", "urdf_numbers", "urdf_remarks"),
    *("urdf_shapes", "urdf_xml", "xl330_published"),
)


def names() -> tuple[str, ...]:
    """Return the names of the robots that come with gsl."""
    package = importlib.import_module("gsl.robots")
    modules = (module.name for module in pkgutil.iter_modules(package.__path__))
    return tuple(sorted(set(modules) - set(_NOT_ROBOTS)))


def is_file(name: str) -> bool:
    """Whether a name is that of a file."""
    return name.lower().endswith(SUFFIXES) or name.startswith(PREFIX)


def see_from(name: str, folder: Path) -> str:
    """Return a robot's name, its file as seen from a folder; an absolute path as it is."""
    if not is_file(name) or name.startswith(PREFIX) or Path(name).is_absolute():
        return name
    return os.path.relpath(Path(name).resolve(), folder.resolve())


def files(name: str) -> tuple[Path, ...]:
    """Return the files that a robot is read from; none of those that come with gsl."""
    return files_of(_there(name)) if is_file(name) else ()


def read_files(name: str) -> dict[str, Path]:
    """Return what a robot is read from, by the setting that names it: its files are part of what a world is."""
    first, *others = files(name) or (None,)
    named = {} if first is None else {"robot": first}
    return named | {f"robot.{path.name if path.suffix.lower() in MESHES else path.suffix[1:]}": path for path in others}


def robot(name: str) -> Robot:
    """Build a robot.

    Raises:
        ConfigError: if nothing is called so.
        InputError: if it is a file that describes no robot.
    """
    if is_file(name):
        return from_file(_there(name))
    place, _, function = name.rpartition(".") if "." in name else (f"gsl.robots.{name}", "", name)
    if "/" in name or not (name in names() or "." in name):
        hint = f"{did_you_mean(name, names(), listed=True)}, a file such as arm.urdf, or robot_descriptions:NAME"
        raise ConfigError("robot", f"no robot called '{name}'{hint}")
    try:
        build = getattr(importlib.import_module(place), function)
        inspect.signature(build).bind()
    except (ImportError, AttributeError, ValueError) as error:
        raise ConfigError("robot", f"'{name}' cannot be imported: {error}") from error
    except TypeError as error:
        raise ConfigError("robot", f"'{name}' is no function that builds a robot of nothing: {error}") from error
    promised = getattr(build, "__annotations__", {}).get("return")
    if is_ours(place) and promised not in (Robot, Robot.__name__):  # any file may name it: it must do nothing else
        raise ConfigError("robot", f"'{name}' is no function that builds a robot")
    built = build()
    if not isinstance(built, Robot):
        raise ConfigError("robot", f"'{name}' returns a value of {type(built).__name__}, not a Robot")
    return built


def _there(name: str) -> Path:
    path = urdf_of(name)
    if not path.exists():
        where = (
            ""
            if path.is_absolute()
            else ", as seen from the current folder; that of a world of yours may be seen from its --config-dir"
        )
        raise InputError(f"{name}: there is no such file{where}")
    return path
