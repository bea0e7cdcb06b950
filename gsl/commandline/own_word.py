"""The user's own word: the modules that he names on the command line, or in GSL_TRUST, and whose code may run."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Override, Quote, QuotedString
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from gsl.commandline.known_settings import list_keys
from gsl.core.likeness import find_alike
from gsl.core.trust import TRUST, modules_in
from gsl.errors import ConfigError
from gsl.models.servo_file import servo_file
from gsl.storage.references import RUNS

VARIABLE = "GSL_TRUST"
ALIKE = 0.75  # trsut is trust; trial is not
_MODULE = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*")
_TRUTH = ("true", "false")
_USUAL = {
    "force": re.compile("(False)?"),
    "executor": re.compile("(local)?"),
    "address": re.compile("(None)?"),
    "out": re.compile(r"(runs/\$\{name\}/[\w${}]+|\$\{request\}/\$\{name\}|None)?"),
}
"""What our files say of settings that a file of others may not say otherwise."""
_appended: set[str] = set()  # folders, to Python's path


def find_trust(arguments: Sequence[str]) -> tuple[str, ...]:
    """Return the modules that a command line names: in `trust=`, and wherever it says itself which class to take.

    Raises:
        ConfigError: `trust` names no module, or is misspelt.
    """
    named = [word for word in os.environ.get(VARIABLE, "").replace(",", " ").split()]
    for key, value in _split_words(arguments):
        if key != TRUST and find_alike(key, [TRUST], cutoff=ALIKE):
            raise ConfigError(key, f"no such setting; did you mean {TRUST}?")
        named += modules_of(value) if key == TRUST else modules_in({key.rpartition(".")[2]: value})
    return tuple(dict.fromkeys(named))


def find_misspelt(arguments: Sequence[str]) -> list[str]:
    """Return the modules that `trust=` names on a command line and that are nowhere to be imported from."""
    words = [argument for argument in arguments if argument.lstrip("+").startswith(f"{TRUST}=")]
    typed = [module for _, value in _split_words(words) for module in modules_of(value)]
    return [module for module in typed if not _is_there(module)]


def _is_there(module: str) -> bool:
    """Whether a module can be imported, without importing it or what it lies in."""
    places: Sequence[str] | None = [os.getcwd(), *sys.path]
    for word in module.split("."):
        # a folder without __init__.py asks for its parent among what is imported, unless it seems to have none
        spec = None if places is None else PathFinder.find_spec(word, places)
        if spec is None:
            return False
        places = None if spec.submodule_search_locations is None else [*spec.submodule_search_locations]
    return True


def modules_of(value: Any) -> tuple[str, ...]:
    """Return the modules that a value of `trust` names, one or a list.

    Raises:
        ConfigError: One of them is no name of a module.
    """
    words = value if isinstance(value, list | tuple) else [value]
    for word in words:
        if not isinstance(word, str) or not _MODULE.fullmatch(word) or word in _TRUTH:
            text = str(word).lower() if isinstance(word, bool) else str(word)
            raise ConfigError(TRUST, "names the modules whose code may run, such as trust=my_module", given=text)
    return tuple(words)


def check_own_word(values: Mapping[str, Any], typed: Collection[str]) -> None:
    """Refuse settings that a file has set and only the user can: they replace artifacts, and write and send elsewhere.

    Args:
        values: All settings of a command, references not replaced.
        typed: Keys that the user has typed.

    Raises:
        ConfigError: It names one of them.
    """
    for key, usual in _USUAL.items():
        if key not in typed and not usual.fullmatch(value := str(values.get(key, ""))):
            raise ConfigError(key, f"is said by a file, and only you can say it: type {key}=...", given=value)


def check_servos(config: DictConfig, arguments: Sequence[str], folder: Path | None) -> None:
    """Refuse a learned servo that a file of settings names and that lies in none of its own or the user's places.

    Args:
        config: All settings of a command.
        arguments: What the user has typed, which may name any place.
        folder: Of the user's yaml files, if there is one.

    Raises:
        ConfigError: There is one.
    """
    places = [place.resolve() for place in (Path.cwd(), RUNS, folder or RUNS)]
    for key in (key for key in list_keys(config) if key.rpartition(".")[2] == "servo"):
        try:
            value = OmegaConf.select(config, key)
            file = servo_file(value).resolve() if isinstance(value, str) and value else None
        except (ConfigError, OmegaConfBaseException):  # there is none, which is told in its time
            continue
        if file and not any(map(file.is_relative_to, places)) and not any(value in word for word in arguments):
            problem = f"is named by a file and leads out of its folder and of yours; if you want it, type {key}=..."
            raise ConfigError(key, problem, given=value)


def find_own_modules(trust: Collection[str]) -> None:
    """Let modules of the current folder be imported once the user has named one; before that nothing in it is code.

    Raises:
        ConfigError: One is loaded from another folder already, where a command of this process was typed before.
    """
    if not trust:
        return
    here = os.getcwd()
    if here in _appended and here in sys.path:
        sys.path.remove(here)
    if here not in sys.path:  # before folders of earlier commands
        sys.path.insert(min((k for k, place in enumerate(sys.path) if place in _appended), default=len(sys.path)), here)
        _appended.add(here)
    for module in filter(None, trust):
        _check_place(module.partition(".")[0])


def _check_place(module: str) -> None:
    specs = (finder.find_spec(module, None) for finder in sys.meta_path if hasattr(finder, "find_spec"))
    there = getattr(next(filter(None, specs), None), "origin", None)
    loaded = getattr(sys.modules.get(module), "__file__", None)
    if there and loaded and os.path.isfile(there) and os.path.realpath(there) != os.path.realpath(loaded):
        problem = f"is loaded from {os.path.dirname(loaded)} already; start Python anew, or give it another name"
        raise ConfigError(TRUST, problem, given=module)


def keep_text(override: Override) -> Override:
    """Return an override that is read as it was typed where it looks like a number: a folder may be called 20."""
    if override.is_delete() or override.is_sweep_override() or not isinstance(override.value(), int | float):
        return override
    key, _, typed = str(override.input_line).partition("=")
    return OverridesParser.create().parse_override(f'{key}="{typed.strip()}"')


def quote(text: str) -> str:
    """Return a text as a command line says it that means just this."""
    return QuotedString(text, Quote.double).with_quotes()


def _split_words(arguments: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """Yield keys and values; what cannot be read is told by whoever composes."""
    parser = OverridesParser.create()
    for argument in arguments:
        try:
            override = parser.parse_override(argument)
        except (HydraException, ValueError, RecursionError):
            continue
        value = override._value
        for choice in value.list if isinstance(value, ChoiceSweep) else [value]:
            yield override.key_or_group, _plain(choice)


def _plain(value: Any) -> Any:
    if isinstance(value, QuotedString):
        return value.text
    if isinstance(value, dict):
        return {str(_plain(key)): _plain(entry) for key, entry in value.items()}
    return [_plain(entry) for entry in value] if isinstance(value, list) else value
