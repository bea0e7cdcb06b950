"""What hydra and its libraries complain about, in one line a user understands."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from omegaconf.errors import InterpolationKeyError, InterpolationResolutionError, MissingMandatoryValue

from gsl.core.validation import did_you_mean
from gsl.errors import ConfigError, InputError

_UNKNOWN = re.compile(r"Could not (?:override|delete from config\.) '([^']+)'")
_NO_OPTION = re.compile(r"Could not find '([^']+)/([^'/]*)'")
_MISSING = re.compile(r"[Mm]issing mandatory value: (\S+)")
_NO_PRIMARY = re.compile(r"Cannot find primary config '([^']+)'")
_MERGED = re.compile(r"Error merging override (\S+)")
_AMBIGUOUS = re.compile(r"Ambiguous value for argument '([^'=]+)=([^']*)'")


@dataclass(frozen=True)
class Vocabulary:
    """The words a command understands.

    Attributes:
        keys: Dotted keys that can be set.
        chosen: Groups of the command's defaults list, such as `task` and `world@sim`.
        options: Gives the names in a group.
    """

    keys: Sequence[str]
    chosen: Mapping[str, str]
    options: Callable[[str], Sequence[str]]


def unknown_key(error: Exception) -> str | None:
    """Return the key that hydra did not find, if that was the matter."""
    match = _UNKNOWN.search(str(error))
    return match.group(1) if match else None


def unfit(command: str, arguments: Sequence[str], unknown: str | None) -> ConfigError | None:
    """Return the error for an experiment or task that sets what a command does not have, if that is the matter."""
    typed = dict(one.lstrip("+").partition("=")[::2] for one in arguments)
    key = next((key for key in typed if key.rpartition(".")[2] in ("experiment", "task")), None)
    if unknown is None or unknown in typed or key is None:
        return None
    return ConfigError(key, f"is not for gsl {command}, which cannot take its {unknown}", given=typed[key])


def translate(error: Exception, words: Vocabulary) -> Exception:
    """Return what composition complains about as a `ConfigError`."""
    text = str(error)
    if option := _NO_OPTION.search(text):
        group, name = option.groups()
        return InputError(
            f"no {group} called {name or '(nothing)'}{did_you_mean(name, words.options(group), listed=True)}"
        )
    if key := unknown_key(error):
        return _no_such_setting(key, words)
    if ambiguous := _AMBIGUOUS.search(text):
        key, value = ambiguous.groups()
        return ConfigError(key, f"several values need --multirun; a list is written '{key}=[{value}]'")
    if primary := _NO_PRIMARY.search(text):
        return InputError(f"there is no {primary.group(1)}.yaml in the configuration")
    if merged := _MERGED.search(text):
        key, _, value = merged.group(1).lstrip("+~").partition("=")
        shape = "a list or a mapping, another shape than what is there"
        return ConfigError(key, f"is {shape}; set single values below it, or take a file without it", given=value)
    return InputError(f"configuration: {' '.join(text.split())}")


def misshapen(arguments: Sequence[str], error: ValueError, words: Vocabulary) -> ConfigError:
    """Return the error for an argument that hydra stumbles over: a group without a name, or a key in a list."""
    if "group" in str(error):
        for key, _, value in (one.partition("=") for one in arguments):
            group = key.lstrip("+")
            if (group in words.chosen or words.options(group)) and (not value[:1].isalpha() or value == "null"):
                return ConfigError(group, "takes the name of a file", given=value)
    last = str(error).rpartition(" ")[2].strip("'")
    keys = [key for one in arguments if last in (key := one.partition("=")[0].lstrip("+~")).split(".")]
    where = keys[0].rpartition(".")[0] if keys else "configuration"
    return ConfigError(where, "is a list of entries here, which have no names; set all of it: KEY=[{...}, {...}]")


def resolution_error(error: Exception) -> Exception:
    """Return what resolving the values complains about as a `ConfigError`."""
    key = str(getattr(error, "full_key", None) or "configuration")
    if isinstance(error, MissingMandatoryValue):
        return missing(key)
    if found := _MISSING.search(str(error)):
        return missing(found.group(1))
    if isinstance(error, InterpolationKeyError | InterpolationResolutionError):
        return ConfigError(key, f"{str(error).splitlines()[0]}")
    return ConfigError(key, str(error).splitlines()[0])


def missing(key: str) -> ConfigError:
    """Return the error for a value that the user has to give."""
    return ConfigError(key, f"has no value yet; say {key}=...")


def _no_such_setting(key: str, words: Vocabulary) -> ConfigError:
    roles = [choice.partition("@")[2] for choice in words.chosen if choice.startswith(f"{key}@")]
    if roles:
        return ConfigError(key, f"here a {key} has a role; say {' or '.join(f'{role}=...' for role in roles)}")
    last = key.rpartition(".")[2]
    deeper = [known for known in words.keys if known.rpartition(".")[2] == last]
    if deeper:
        return ConfigError(key, f"no such setting; did you mean {' or '.join(deeper[:3])}?")
    shown = [known for known in words.keys if not known.endswith("_target_")]
    level = [known for known in shown if known.rpartition(".")[0] == key.rpartition(".")[0]]
    level = level or [known for known in shown if "." not in known]
    near = did_you_mean(key, words.keys)
    return ConfigError(key, "no such setting" + (near if "did you mean" in near else did_you_mean(key, level)))
