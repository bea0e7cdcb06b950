"""What hydra and its libraries complain about, in one line a user understands."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from glob import escape
from pathlib import Path
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException, MissingConfigException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import InterpolationToMissingValueError, MissingMandatoryValue

from gsl.commandline.known_settings import is_idle, list_keys
from gsl.commandline.overrides import COMMAND_KEYS, FILE_GROUPS, OPTIONAL_GROUPS
from gsl.core.validation import NO_SUCH, did_you_mean
from gsl.errors import ConfigError, InputError

_UNKNOWN = re.compile(r"Could not (?:override|delete from config\.) '([^']+)'")  # hydra's exception has no field for it
_MERGED = "Error merging override "
_PLACES = re.compile(r'[^\s,:"\[\]{}]*(?:\{\w+\}[^\s,:"\[\]{}]*)+')  # a text of a mapping: {date}/{motion}
_FILE = re.compile(r"In '([^']+)'")  # in which a yaml file says something of another shape
_ROUND = ("Recursive interpolation", "RecursionError")  # the second within an entry of a list
_WRITE = "write the value itself"


@dataclass(frozen=True)
class Vocabulary:
    """The words a command understands.

    Attributes:
        config: Whose keys can be set.
        chosen: Groups of the command's defaults list, such as `task` and `world@sim`.
    """

    config: DictConfig
    chosen: Mapping[str, str]


def unknown_key(error: Exception) -> str | None:
    """Return the key that hydra did not find, if that was the matter."""
    match = _UNKNOWN.search(str(error))
    return match.group(1) if match else None


def unfit(command: str, arguments: Sequence[str], unknown: str | None) -> ConfigError | None:
    """Return the error for an experiment or task that sets what a command does not have, if that is the matter."""
    typed = dict(argument.lstrip("+").partition("=")[::2] for argument in arguments)
    key = next((key for key in typed if key.rpartition(".")[2] in ("experiment", "task")), None)
    if unknown is None or unknown in typed or key is None:
        return None
    return ConfigError(key, f"is not for gsl {command}, which cannot take its {unknown}", given=typed[key])


def translate(error: Exception, words: Vocabulary) -> Exception:
    """Return what composition complains about as a `ConfigError`."""
    text, file = str(error), getattr(error, "missing_cfg_file", None) or ""
    if isinstance(error, MissingConfigException) and error.options is not None:
        groups = {*OPTIONAL_GROUPS, *(choice.partition("@")[0] for choice in words.chosen)}
        group = next((group for group in groups if file.startswith(f"{group}/")), file.rpartition("/")[0])
        name = file.removeprefix(f"{group}/")
        is_path = "/" in name or (name.endswith((".yaml", ".yml", ".urdf")) and Path(name).stem not in error.options)
        hint = _own_file(group, Path(name)) if is_path else _own_folder(group, name)
        hint = hint or did_you_mean(name, error.options, listed=True)
        return InputError(f"no {group} called {name or '(nothing)'}{hint}")
    if key := unknown_key(error):
        return _no_such_setting(key, words)
    if isinstance(error, MissingConfigException):
        return InputError(f"there is no {file}.yaml in the configuration")
    if text.startswith(_MERGED):
        key, _, value = text.removeprefix(_MERGED).lstrip("+~").partition("=")
        shape = "a list or a mapping, another shape than what is there"
        return ConfigError(key, f"is {shape}; set single values below it, or take a file without it", given=value)
    if file := _FILE.match(text):
        return InputError(f"{file[1]}.yaml: says a list where settings by name are, or the other way round; mend that")
    return InputError(f"configuration: {' '.join(text.split()) or 'holds what no setting can be, such as a set'}")


def of_the_command(error: ConfigError, config: Mapping[str, Any]) -> ConfigError:
    """Return a better error for what a file says of a component, such as a mapping, and is of the command itself."""
    above, _, name = error.setting.rpartition(".")
    if above and error.problem.startswith(NO_SUCH) and name in {*COMMAND_KEYS, *config}:
        return ConfigError(error.setting, f"is a setting of the command, and not of {above}; type {name}=... yourself")
    return error


def _own_file(group: str, place: Path) -> str:
    """Return how a file of the user's own is taken that was named by its path, or by the folder around it."""
    from gsl.storage.references import RUNS

    if group == "world" and place.suffix == ".urdf":
        return (
            f"; a robot is a setting of the world urdf: world=urdf world.robot={place}, or sim=urdf sim.robot={place}"
        )
    inside = (sorted(folder.glob(f"{group}/*.yaml")) for folder in (place, RUNS / place, place.parent))
    if place.parent.name == group:
        folder, names = place.parent.parent.as_posix(), [place.stem]
    elif files := next(filter(None, inside), None):
        folder, names = files[0].parents[1].as_posix(), [path.stem for path in files]
    else:
        folder, names = f"FOLDER, in which it is {group}/{place.stem}.yaml", [place.stem]
    return f"; a file of your own is taken by its name: {' or '.join(names)}, with --config-dir {folder}"


def _own_folder(group: str, name: str) -> str:
    """Return which folder of the current one holds a file of a group, or that a mapping lies here, if that is so."""
    if group in FILE_GROUPS and Path(f"{name}.yaml").is_file():
        return f"; yours is {group}={name}.yaml"
    folders = [path.parents[1].as_posix() for path in sorted(Path().glob(f"*/{group}/{escape(name)}.yaml"))]
    return f"; it is in {' and '.join(folders)}: say --config-dir {folders[0]}" if folders else ""


def unreadable(override: str, parser: OverridesParser) -> str:
    """Return what is wrong with a value: that it takes quotes within those of the shell, if these mend it."""
    key, _, value = override.partition("=")
    places = _PLACES.sub(r'"\g<0>"', value)
    quoted = places if places != value else f'"{value}"'
    if not value or "'" in value or (quoted != places and value[0] in '[{"'):  # more than a word of odd characters
        return "cannot be read"
    try:
        parser.parse_override(f"{key}={quoted}")
    except HydraException:
        return "cannot be read"
    return f"cannot be read; such characters take quotes inside those of the shell: '{key}={quoted}'"


def shapeless(key: str, name: str, value: str | float) -> ConfigError:
    """Return the error for a setting below one that is a single value, such as the column of a signal."""
    hint = f"; with a {name} it is '{key}={{column: \"{value}\", {name}: ...}}'" if ".signals." in key else ""
    return ConfigError(key, f"is a single value and has no {name}{hint}", given=str(value))


def misshapen(arguments: Sequence[str], error: ValueError) -> ConfigError:
    """Return the error for an argument that hydra stumbles over: a key in a list."""
    last = str(error).rpartition(" ")[2].strip("'")
    keys = [key for argument in arguments if last in (key := argument.partition("=")[0].lstrip("+~")).split(".")]
    where = keys[0].rpartition(".")[0] if keys else "configuration"
    return ConfigError(where, f"is a list, whose entries have no names; set all of it: '{where}=[{{...}}, {{...}}]'")


def resolution_error(error: Exception) -> Exception:
    """Return what resolving the values complains about as a `ConfigError`."""
    key = str(getattr(error, "full_key", None) or "configuration")
    if isinstance(error, MissingMandatoryValue):
        return missing(key)
    problem = str(error).splitlines()[0]
    if isinstance(error, InterpolationToMissingValueError):
        return missing(problem.rpartition(" ")[2])
    nowhere = re.search(r"key '([^']*)'", problem)
    if nowhere is not None:
        return ConfigError(key, f"refers to {nowhere[1].lstrip('.')}, and this command has no such setting; {_WRITE}")
    if any(word in problem for word in _ROUND):
        return ConfigError(key, f"refers to itself; {_WRITE}")
    return ConfigError(key, f"refers to a setting in a way that cannot be read; {_WRITE}")


def missing(key: str) -> ConfigError:
    """Return the error for a value that the user has to give."""
    return ConfigError(key, f"has no value yet; say {key}=...")


def _no_such_setting(key: str, words: Vocabulary) -> ConfigError:
    roles = [choice.partition("@")[2] for choice in words.chosen if choice.startswith(f"{key}@")]
    if roles:
        return ConfigError(key, f"has a role here; say {' or '.join(f'{role}=...' for role in roles)}")
    text, last = OmegaConf.to_yaml(words.config), key.rpartition(".")[2]
    keys = [declared for declared in list_keys(words.config) if not is_idle(declared, text)]
    deeper = [declared for declared in keys if declared.rpartition(".")[2] == last]
    if deeper:
        return ConfigError(key, f"no such setting; did you mean {' or '.join(deeper[:3])}?")
    shown = [declared for declared in keys if not declared.endswith("_target_")]
    level = [declared for declared in shown if declared.rpartition(".")[0] == key.rpartition(".")[0]]
    level = level or [declared for declared in shown if "." not in declared]
    near = did_you_mean(key, keys)
    return ConfigError(key, "no such setting" + (near if "did you mean" in near else did_you_mean(key, level)))
