"""Validation turns a mapping into a component, or into one line: the setting, its value and what it must be."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import ArgsKwargs, ErrorDetails

from gsl.core.likeness import find_alike
from gsl.core.setting import settings_of
from gsl.core.trust import TARGET
from gsl.errors import ConfigError, shorten

T = TypeVar("T")

NO_SUCH = "no such setting"
"""What an error of a setting that is none begins with."""
_UNEXPECTED = re.compile(r"unexpected keyword argument '(\w+)'")
_ADDRESS = re.compile(r" (object )?at 0x[0-9a-f]+")  # in memory: it says nothing
_RULES = {
    "greater_than_equal": "must be at least {ge:g}",
    "greater_than": "must be above {gt:g}",
    "less_than_equal": "must be at most {le:g}",
    "less_than": "must be below {lt:g}",
    "finite_number": "must be a finite number",
    "literal_error": "must be one of {expected}",
    "is_instance_of": "must be a {class}",
    "string_too_short": "must not be empty",
    "too_short": "needs {min_length} at least",
    "truth_value": "must be a number",
    "missing": "has no value",
    "missing_argument": "has no value",
}
_KINDS = {"int": "a whole number", "float": "a number", "bool": "true or false", "string": "a text", "tuple": "a list"}
_KINDS |= {"list": "a list", "dict": "settings by name"}


def make(target: Callable[..., T], values: Mapping[str, Any], *, where: str = "") -> T:
    """Build a component from a mapping of its settings.

    Args:
        target: A class made by `component`.
        values: Its settings by name.
        where: Dotted path of the mapping, such as `effects.backlash`.

    Raises:
        ConfigError: A setting is unknown, missing or has an impossible value.
    """
    for key in values:
        if not isinstance(key, str) or key.startswith("__"):
            raise ConfigError(".".join(filter(None, [where, str(key)])), "is no name of a setting")
    try:
        return target(**values)
    except ValidationError as error:
        inside = "" if error.title == getattr(target, "__name__", "") else error.title  # made by the component itself
        raise config_error(error, target, where=".".join(filter(None, [where, inside]))) from None
    except TypeError as error:
        unexpected = _UNEXPECTED.search(str(error))
        if unexpected is None:
            if error.__traceback__ is None or error.__traceback__.tb_next is not None:
                raise  # within what was called
            name = ".".join(filter(None, [where, TARGET]))
            raise ConfigError(name, f"cannot be made of its settings ({error})", given=_name_of(target)) from error
        name = ".".join(filter(None, [where, unexpected[1]]))
        raise ConfigError(name, f"{NO_SUCH}{did_you_mean(unexpected[1], settings_of(target))}") from error


def config_error(error: ValidationError, target: Callable[..., Any], *, where: str = "") -> ConfigError:
    """Return the most telling of pydantic's complaints about building `target` at the dotted path `where`."""
    complaints = sorted(error.errors(), key=lambda detail: detail["type"] != "unexpected_keyword_argument")
    details = complaints[0]
    location = [str(part) for part in details["loc"][:1]]
    location += [str(part) for part in details["loc"][1:] if isinstance(part, int)]
    path = ".".join([*filter(None, [where]), *location])
    if details["type"] == "unexpected_keyword_argument":
        return ConfigError(path, f"{NO_SUCH}{did_you_mean(location[-1], settings_of(target))}")
    setting = settings_of(target).get(location[0]) if location else None
    unit = f" ({setting.unit})" if setting is not None and setting.unit else ""
    return ConfigError(path or target.__name__, f"{_problems(complaints)}{unit}", given=_quote(details["input"]))


def did_you_mean(word: str, candidates: Iterable[str], *, listed: bool = False) -> str:
    """Return `; did you mean ...?` and, where nothing is near or `listed`, the list of what there is."""
    names = sorted(candidates)
    alike = {name.casefold(): name for name in names}
    near = [shorten(alike[match]) for match in find_alike(word.casefold(), alike, most=2)]
    question = f"; did you mean {' or '.join(near)}?" if near else ""
    if near and not listed or not names:
        return question
    return f"{question}{' T' if near else '; t'}here is {', '.join(map(shorten, names))}"


def _problems(complaints: Sequence[ErrorDetails]) -> str:
    """Return what is wrong with the first setting; one that may be of several types breaks the rules of each."""
    first = complaints[0]["loc"]
    ways = [
        complaint
        for complaint in complaints
        if complaint["loc"][:1] == first[:1] and isinstance([*complaint["loc"], 0][1], str)
    ]
    words = dict.fromkeys(_problem(complaint) for complaint in (ways or complaints[:1]))
    return ", or ".join(word if index == 0 else word.removeprefix("must be ") for index, word in enumerate(words))


def _problem(details: ErrorDetails) -> str:
    context = dict(details.get("ctx", {}))
    if details["type"] == "value_error":
        return str(context["error"])
    if details["type"] in _RULES:
        return _RULES[details["type"]].format(**context)
    kind = _KINDS.get(details["type"].split("_")[0])
    if kind == "a text" and isinstance(details["input"], int | float):  # a folder called 20
        quoted = f'"{_quote(details["input"])}"'
        return f"must be a text: {quoted} in a file, '{quoted}' in a shell"
    return f"must be {kind}" if kind else details["msg"][0].lower() + details["msg"][1:]


def _name_of(target: Callable[..., Any]) -> str:
    return f"{target.__module__}.{getattr(target, '__qualname__', '')}"


def _quote(value: object) -> str:
    if isinstance(value, ArgsKwargs):
        return ""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    text = value if isinstance(value, str) else _ADDRESS.sub("", repr(value))
    return text if len(text) <= 60 else f"{text[:57]}..."
