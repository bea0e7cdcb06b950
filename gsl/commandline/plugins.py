"""Commands of other packages, found as entry points of the group `gsl.commands` and imported when they are run.

An entry point names a stage, whose yaml file lies in the folder conf/ of its package, a function, or a typer.Typer.
"""

from __future__ import annotations

import ast
import inspect
import os
import sys
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_group

from gsl.commandline.stage_command import add_stage
from gsl.errors import GslError

GROUP = "gsl.commands"
CONF = "conf"


class StandIn(TyperCommand):
    """What is known of a command before its package is imported: its name and a line for the help."""

    def __init__(self, entry_point: EntryPoint) -> None:
        super().__init__(entry_point.name, rich_markup_mode=None)
        self.entry_point = entry_point

    def get_short_help_str(self, limit: int = 45) -> str:
        """Return the line for the help, which is read when it is asked for."""
        return summary(self.entry_point)


class Commands(TyperGroup):
    """gsl's own commands, and those of other packages after them; an own one hides another of its name."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        for command in self.commands.values():  # in whole: click cuts the first line of a docstring at 45 characters
            command.short_help = command.short_help or (command.help or "").partition("\n\n")[0]
        for name, entry_point in sorted(plugins().items()):
            self.commands.setdefault(name, StandIn(entry_point))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Import the command that is run."""
        name, command, rest = super().resolve_command(ctx, args)
        return name, load(command.entry_point) if isinstance(command, StandIn) else command, rest


def plugins() -> dict[str, EntryPoint]:
    """Return the entry points by the name of their command."""
    return _find(tuple((place, _read_mtime(place)) for place in sys.path))


@lru_cache(maxsize=1)  # every word that is typed asks for them, and each time all packages would be read
def _find(places: tuple[tuple[str, int], ...]) -> dict[str, EntryPoint]:
    """Return the entry points of packages in these places, as they were at these times."""
    return {entry_point.name: entry_point for entry_point in entry_points(group=GROUP)}


def _read_mtime(place: str) -> int:
    try:
        return os.stat(place or ".").st_mtime_ns
    except OSError:
        return 0


def load(entry_point: EntryPoint) -> Any:
    """Import a command.

    Raises:
        GslError: It cannot be imported, or is no command.
    """
    name = entry_point.name
    app = typer.Typer(rich_markup_mode=None)
    try:
        command = entry_point.load()
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name)
        elif inspect.isclass(command):
            add_stage(app, name, summary(entry_point))
        else:
            app.command(name)(command)
        return get_group(app).commands[name]
    except (Exception, SystemExit) as error:
        package = entry_point.dist.name if entry_point.dist else "?"
        why = f"{type(error).__name__}: {' '.join(str(error).split())}"
        problem = f"{entry_point.value} of the package {package} cannot be loaded: {why}"
        raise GslError(f"{problem}; repair that package or uninstall it") from error


def is_group(name: str) -> bool:
    """Whether a command of another package has commands of its own."""
    try:
        return name in plugins() and isinstance(load(plugins()[name]), TyperGroup)
    except GslError:
        return False


def packages() -> list[str]:
    """Return the packages that bring commands: they were installed, so their files may name what is in them."""
    return sorted({name for entry_point in plugins().values() if (name := _package(entry_point))})


def folders() -> list[Path]:
    """Return the folders conf/ of the packages that bring commands."""
    places = (place / CONF for name in packages() if (place := _place(name)) is not None)
    return [place for place in places if place.is_dir()]


def summary(entry_point: EntryPoint) -> str:
    """Return the first line of what a command says of itself, read without importing it; nothing if that fails."""
    place = _place(_package(entry_point))
    if place is None:
        return ""
    path = place.joinpath(*entry_point.module.split(".")[1:])
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    try:
        tree = ast.parse(file.read_text(encoding="utf-8"))
    except (OSError, SyntaxError, ValueError):
        return ""
    named = [node for node in tree.body if getattr(node, "name", None) == entry_point.attr]
    documented = [node for node in named if isinstance(node, ast.ClassDef | ast.FunctionDef)]
    return (ast.get_docstring(documented[0] if documented else tree) or "").partition("\n")[0]


def _package(entry_point: EntryPoint) -> str:
    """Return the package of a command; nothing if its entry point cannot be read, as is said when the command runs."""
    readable = entry_point.pattern.match(entry_point.value)
    return readable["module"].partition(".")[0] if readable else ""


def _place(package: str) -> Path | None:
    """Return the folder of a package, or the path of a lone module without its suffix; None if there is none."""
    try:
        spec = find_spec(package)
    except (ImportError, ValueError):
        return None
    if spec is not None and spec.submodule_search_locations:
        return Path(next(iter(spec.submodule_search_locations)))
    return Path(spec.origin).with_suffix("") if spec is not None and spec.origin else None
