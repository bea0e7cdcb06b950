"""What an effect is, and how a world's `effects:` mapping becomes a tuple of them.

An effect is a component with a `kind`, a `rank` among its kind, parameters and `apply(plant) -> plant`. Its name is its
module: `backlash` is the class `Backlash` of gsl/effects/backlash.py. A user's own effect stands beside the library's
by the name of its yaml file (`use_own`), or is named by `_target_`.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import Any, ClassVar, Literal, Protocol, get_origin, get_type_hints, runtime_checkable

import numpy as np

from gsl.core.body import Link, Robot
from gsl.core.likeness import find_alike
from gsl.core.plant import Plant
from gsl.core.setting import REQUIRED, Setting, settings_of
from gsl.core.validation import make
from gsl.errors import ConfigError

KINDS = ("command", "servo", "body", "contact", "environment", "sensor")

TWINS = {"sensor_bias": "zero_offset"}  # alike by nature in the air (the design's section 4)

Scope = str | tuple[str, ...]
PLACES = ("joints", "link")  # settings that say where an effect acts
SCOPE = "where it acts: all, a group such as legs or arms, a joint, or a list of these"


@runtime_checkable
class Effect(Protocol):
    """Something a simulator leaves out, as a change of the plant."""

    kind: ClassVar[str]
    rank: ClassVar[int]

    def apply(self, plant: Plant) -> Plant:
        """Return the plant with this effect in it."""


_OWN: dict[str, type] = {}  # effects of a user's own in this process, by name
_SEEN: dict[str, type] = {}  # all that this process has had: worlds that are there have theirs
_WITHHELD: dict[str, ConfigError] = {}  # those that may not be used, with what to do


def use_own(classes: Mapping[str, type], refused: Mapping[str, ConfigError] | None = None) -> None:
    """Have effects of a user's own stand beside the library's from now on, or before one of the same name.

    Args:
        classes: By name; those of before are forgotten.
        refused: What is raised for others that are named.

    Raises:
        ConfigError: One of them is no effect, or could not be searched.
    """
    for name, kind in classes.items():
        check_own(name, kind)
    _OWN.clear()
    _OWN.update(classes)
    _SEEN.update(classes)
    _WITHHELD.clear()
    _WITHHELD.update(refused or {})


def own() -> Mapping[str, type]:
    """Return the effects of a user's own, by name."""
    return dict(_OWN)


def own_of(effects: Mapping[str, Any]) -> Mapping[str, type]:
    """Return the classes of those among some effects by name that are a user's own, in use now or before."""
    kinds = {name: kind for name, kind in _SEEN.items() if name not in _library()} | _OWN
    return {name: kinds[name] for name in effects if name in kinds}


def add_own(classes: Mapping[str, type]) -> None:
    """Have effects of a user's own beside those in use: a world that is there has them."""
    _OWN.update(classes)
    _SEEN.update(classes)


@contextmanager
def keep_own() -> Iterator[None]:
    """Within, other effects of a user's own may be in use; afterwards those of before are."""
    own, withheld = dict(_OWN), dict(_WITHHELD)
    try:
        yield
    finally:
        use_own(own, withheld)


def withheld(name: str) -> ConfigError | None:
    """Return why an effect of a user's own may not be used, None of any other name."""
    return _WITHHELD.get(name)


def check_own(name: str, kind: Any) -> None:
    """Refuse a class that is no effect, or that nothing could draw or search.

    Raises:
        ConfigError: It is one.
    """
    where = f"effects.{name}"
    if not (hasattr(kind, "__pydantic_fields__") and _is_effect(kind)):
        raise ConfigError(where, "is no effect; it needs @component, `kind`, `rank` and `apply`", given=kind.__name__)
    if kind.kind not in KINDS:
        raise ConfigError(f"{where}.kind", f"must be one of {', '.join(KINDS)}", given=str(kind.kind))
    hints = get_type_hints(kind)
    for key, value in settings_of(kind).items():
        chosen = key in PLACES or get_origin(hints[key]) is Literal or value.default is not REQUIRED
        if not chosen and (value.lower is None or value.upper is None):
            raise ConfigError(f"{where}.{key}", "needs a documented range: setting(..., lower=, upper=), or a default")


def _is_effect(kind: type) -> bool:
    return all(hasattr(kind, name) for name in ("kind", "rank", "apply"))


def names() -> tuple[str, ...]:
    """Return the names of all effects, the library's and a user's own."""
    return tuple(sorted({*_library(), *_OWN}))


@cache
def _library() -> tuple[str, ...]:
    package = importlib.import_module("gsl.effects")
    return tuple(sorted(module.name for module in pkgutil.iter_modules(package.__path__) if module.name != "effect"))


def effect_class(name: str) -> type[Any]:
    """Return the class of an effect of the library, or of a user's own.

    Raises:
        ConfigError: if there is none of that name.
    """
    if name in _OWN:
        return _OWN[name]
    if name in _WITHHELD:
        raise _WITHHELD[name]
    if name in _SEEN and name not in _library():
        return _SEEN[name]
    if name not in names():
        near = find_alike(name, names())
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(names())}"
        raise ConfigError(f"effects.{name}", f"no effect of this name; {hint}")
    module = importlib.import_module(f"gsl.effects.{name}")
    return getattr(module, "".join(word.capitalize() for word in name.split("_")))


def describe_confusion(name: str) -> str:
    """Return what an effect is confused with and what separates them, from its class."""
    text = " ".join((effect_class(name).__doc__ or "").split()).partition("Confused with ")[2]
    return re.split(r"\.(?:\s|$)", text, maxsplit=1)[0]


def list_documented(name: str, robot: Robot) -> dict[str, Setting]:
    """Return the settings of an effect with the ranges that a robot documents, where they differ from a NAO's class."""
    return narrow_settings(effect_class(name), robot.ranges.get(name, {}))


def narrow_settings(kind: type[Any], own: Mapping[str, tuple[float, float]]) -> dict[str, Setting]:
    """Return the settings of a class of effects with other ranges, by parameter, in place of its own."""
    return {
        key: replace(setting, lower=own[key][0], upper=own[key][1]) if key in own else setting
        for key, setting in settings_of(kind).items()
    }


def check_ranges(name: str, ranges: Mapping[str, tuple[float, float]]) -> None:
    """Refuse ranges of an effect, or of parameters, that do not exist or could not be searched.

    Raises:
        ConfigError: One of them.
    """
    try:
        settings = settings_of(effect_class(name))
    except ConfigError as error:
        raise ConfigError(f"ranges.{name}", error.problem) from error
    for key, (lower, upper) in ranges.items():
        if key not in settings or settings[key].lower is None:
            raise ConfigError(f"ranges.{name}.{key}", "the effect has no parameter of this name with a range")
        most = settings[key].most
        if not lower < upper or (most is not None and upper > most):
            limit = "" if most is None else f", {most:g} at most"
            raise ConfigError(f"ranges.{name}.{key}", f"{lower:g} to {upper:g} is no range that it can have{limit}")


def build(effects: Mapping[str, Any]) -> tuple[Effect, ...]:
    """Build every entry of an `effects:` mapping, in the order in which they are applied, whatever the mapping's."""
    made = [
        _effect(name, entry)
        for name, entries in effects.items()
        for entry in (entries if isinstance(entries, list | tuple) else [entries])
    ]
    return tuple(sorted(made, key=lambda effect: (KINDS.index(effect.kind), effect.rank)))


def _effect(name: str, entry: Any) -> Effect:
    if isinstance(entry, Mapping):
        kind = _class_in_use(name, entry["_target_"]) if "_target_" in entry else effect_class(name)
        settings = {key: value for key, value in entry.items() if key != "_target_"}
        made: Effect = make(kind, settings, where=f"effects.{name}")
        return made
    if not isinstance(entry, Effect):
        raise ConfigError(f"effects.{name}", "must map the effect's parameters to values", given=str(entry))
    return entry


def _class_in_use(name: str, target: str) -> type:
    """Return a class that this process uses already: a file may name it, but loads nothing.

    Raises:
        ConfigError: There is none, or it is no effect.
    """
    place, _, word = target.rpartition(".")
    kind = getattr(sys.modules.get(place), word, None)
    if not (isinstance(kind, type) and _is_effect(kind)):
        advice = f"keep it as effect/{name}.yaml in the folder of --config-dir"
        raise ConfigError(f"effects.{name}._target_", f"is no effect that is loaded; {advice}", given=target)
    return kind


def together(parts: Iterable[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Return several `effects:` mappings as one with the entries of all; two entries of one effect both act."""
    whole: dict[str, list[Any]] = {}
    for part in parts:
        for name, entries in part.items():
            whole.setdefault(name, []).extend(entries if isinstance(entries, list | tuple) else [entries])
    return {name: entries for name, entries in whole.items() if entries}


def apply_all(plant: Plant, effects: Iterable[Effect]) -> Plant:
    """Return the plant with all effects in it."""
    for effect in effects:
        try:
            plant = effect.apply(plant)
        except ConfigError as error:
            raise error.under(f"effects.{name_of(effect)}") from error
    return plant


def name_of(effect: Effect) -> str:
    """Return the name of an effect."""
    mine = [name for name, kind in _OWN.items() if kind is type(effect)]
    return mine[0] if mine else type(effect).__module__.rpartition(".")[2]


def scope(plant: Plant, joints: Scope) -> np.ndarray:
    """Return which motors a scope names, shape (n_motors,).

    Raises:
        ConfigError: if a word is neither `all`, a group nor a joint of the robot.
    """
    try:
        return plant.mask(joints)
    except KeyError as error:
        names = ("all", *plant.robot.groups, *plant.robot.motors)
        near = find_alike(str(error.args[0]), names)
        hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(names)}"
        raise ConfigError("joints", f"the {plant.robot.name} has no joint or group '{error.args[0]}'; {hint}") from None


def link_named(plant: Plant, name: str) -> Link:
    """Return a link of the robot.

    Raises:
        ConfigError: if it has none of that name.
    """
    links = plant.robot.links
    if name not in links:
        near = find_alike(name, links)
        hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(links)}"
        raise ConfigError("link", f"the {plant.robot.name} has no link '{name}'; {hint}")
    return links[name]


def with_link(plant: Plant, link: Link) -> Plant:
    """Return the plant with another link of the same name."""
    return replace(plant, robot=replace(plant.robot, links={**plant.robot.links, link.name: link}))
