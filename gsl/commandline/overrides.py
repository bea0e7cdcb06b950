"""Overrides are the KEY=VALUE arguments of a stage; short forms are rewritten to hydra's own before hydra sees them.

sim=nao_ideal                           world@sim=nao_ideal
world.effects.backlash.width=0.02       ++world.effects.backlash.width=0.02
experiment=arm                          +experiment=arm
out=runs/a                              ++out=runs/a
methods=none,ane                        ~methods.gat ... +grounding@methods.ane=ane
mapping=logs/my_arm.yaml                mapping=<from the folder of the mappings>/logs/my_arm
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

from gsl.errors import ConfigError, InputError

EXECUTOR_KEYS = ("executor", "address")  # of commands that have workers
COMMAND_KEYS = ("name", "out", "force", "trust", *EXECUTOR_KEYS)
"""Settings of the command, not of the stage; every command takes them, whether its yaml names them or not."""
NAMES = ("name", "out")  # those of them that are texts, whatever they look like

OPTIONAL_GROUPS = ("experiment", "grounding")
"""Groups a command may choose from without having a default."""

FILE_GROUPS = ("mapping",)
"""Groups of which a path to a yaml file of one's own is an option, too."""
_ROOT = "../" * 64  # from whatever folder of configuration, up to the root of the file system

FAMILIES = ("methods", "worlds")  # settings of a study that hold many choices from one group, each under its name
_NAMES = re.compile(r"\w+(?: *, *\w+)*")

_EFFECT = re.compile(r"(?:.*\.)?(?<!methods\.)effects\.[A-Za-z_]\w*")  # `methods.effects` is a method of that name


def rewrite(arguments: Iterable[str], chosen: Collection[str]) -> list[str]:
    """Return the arguments as hydra wants them.

    Args:
        arguments: What the user typed.
        chosen: Keys of the command's defaults list, such as `task` and `world@sim`.

    Raises:
        ConfigError: An argument is not of the form key=value.
    """
    roles = {choice.partition("@")[2]: choice for choice in chosen if "@" in choice}
    words: list[str] = []
    for argument in arguments:
        family = _expand(argument, chosen)
        words += [_rewritten(argument, roles, chosen)] if family is None else family
    return words


def file_of(command: str) -> str:
    """Return the name of a command's yaml file, and of the folder that it writes by default."""
    return command.replace("-", "_").replace(" ", "_")


def key_of(argument: str) -> str:
    """Return the key of an override without its prefix."""
    return argument.partition("=")[0].lstrip("+~")


def effect_path(key: str) -> str:
    """Return the dotted path of the effect that a key is about, `world.effects.backlash`, or nothing."""
    match = _EFFECT.match(key)
    return match.group(0) if match else ""


def _expand(argument: str, chosen: Collection[str]) -> list[str] | None:
    """Return what leaves only the named members in a family and adds those that are new; None of another argument."""
    key, _, value = argument.partition("=")
    members = {choice.rpartition(".")[2]: choice for choice in chosen if choice.partition("@")[2].startswith(f"{key}.")}
    plain = value.strip("'\" ").removeprefix("[").removesuffix("]").strip()
    if key not in FAMILIES or not members or not _NAMES.fullmatch(plain):
        return None
    names = dict.fromkeys(re.split(" *, *", plain))
    group = next(iter(members.values())).partition("@")[0]
    dropped = [f"~{key}.{member}" for member in members if member not in names]
    return [*dropped, *(f"+{group}@{key}.{name}={name}" for name in names if name not in members)]


def _rewritten(argument: str, roles: Mapping[str, str], chosen: Collection[str]) -> str:
    if argument.startswith("~"):
        return argument
    key, equals, value = argument.partition("=")
    if not key.lstrip("+"):
        raise ConfigError(f"'{argument}'", "names no setting; write key=value")
    if not equals:
        raise ConfigError(argument, "has no value; write key=value")
    if key.startswith("+"):
        return argument
    plain = value[1:-1] if value[:1] in ("'", '"') and value[-1:] == value[0] else value
    if key in FILE_GROUPS and (plain.endswith((".yaml", ".yml")) or Path(plain).is_file()):
        return f"{key}={_as_option(key, Path(plain))}"
    if key in roles:
        return f"{roles[key]}={value}"
    if effect_path(key) or key in COMMAND_KEYS:
        return f"++{key}={value}"
    if key in OPTIONAL_GROUPS and key not in chosen:
        return f"+{key}={value}"
    return argument


def _as_option(group: str, path: Path) -> str:
    """Return the name under which hydra finds a yaml file that lies anywhere."""
    if path.suffix != ".yaml":
        raise InputError(f"{group} = {path}: is no {group}, whose file's name must end with .yaml")
    if not path.is_file():
        raise InputError(f"{group} = {path}: there is no such file")
    place = path.parent.resolve() / path.stem  # not where a link leads: a name without .yaml is none of hydra's
    name = _ROOT + place.as_posix().lstrip("/")
    return name if re.fullmatch(r"[\w./-]+", name) else "'" + name.replace("\\", "\\\\").replace("'", "\\'") + "'"
