"""What every component promises: settings that say what they mean, and a way into a file, a worker process and back."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import FrozenInstanceError, fields, is_dataclass
from typing import Any

import numpy as np

from gsl.core.described import describe, restore
from gsl.core.setting import settings_of
from gsl.core.trust import modules_in
from gsl.errors import ConfigError


def require(thing: Any, holds: bool, promise: str) -> None:
    """Raise an AssertionError that names a class and its promise, unless it holds."""
    if not holds:
        raise AssertionError(f"{type(thing).__name__}: {promise}")


def check_component(component: Any) -> None:
    """Check that a component is frozen, explains its settings, can be pickled and be written into a file.

    Args:
        component: An instance, with whatever settings.
    """
    require(component, is_dataclass(component), "is no component; put @component above the class")
    name = next((field.name for field in fields(component)), "setting")
    try:
        setattr(component, name, getattr(component, name, None))
        frozen = False
    except FrozenInstanceError:
        frozen = True
    require(component, frozen, "can be changed; put @component above the class")
    for field in settings_of(type(component)).values():
        promise = f"{field.name} does not say what it means; write Annotated[..., setting(meaning, unit=...)]"
        require(component, bool(field.meaning), promise)
    try:
        again = pickle.loads(pickle.dumps(component))  # noqa: S301  our own bytes
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise AssertionError(f"{type(component).__name__}: cannot go to a worker process ({error})") from error
    require(component, alike(describe(again), describe(component)), "is another one after pickling")
    try:
        plain = describe(component)
        back = restore(plain, trust=modules_in(plain))
    except ConfigError as error:
        raise AssertionError(f"{type(component).__name__}: cannot be built again from a file: {error}") from error
    require(component, alike(describe(back), describe(component)), "is another one when read from a file")


def flat(thing: Any, where: str = "") -> dict[str, Any]:
    """Return the arrays, numbers and words in dataclasses, tuples and mappings, by dotted name."""
    if isinstance(thing, tuple) and hasattr(thing, "_asdict"):
        thing = thing._asdict()
    if is_dataclass(thing) and not isinstance(thing, type):
        thing = {field.name: getattr(thing, field.name) for field in fields(thing)}
    if isinstance(thing, list | tuple):
        thing = dict(enumerate(thing))
    if isinstance(thing, Mapping):
        return {key: leaf for name, part in thing.items() for key, leaf in flat(part, f"{where}.{name}").items()}
    return {where: np.array(thing) if isinstance(thing, np.ndarray) else thing}


def alike(first: Any, second: Any) -> bool:
    """Whether two things hold the same, to the bit."""
    ours, theirs = flat(first), flat(second)
    return ours.keys() == theirs.keys() and all(_equal(ours[key], theirs[key]) for key in ours)


def _equal(first: Any, second: Any) -> bool:
    if isinstance(first, np.ndarray) or isinstance(second, np.ndarray):
        return bool(np.array_equal(first, second))
    return bool(first == second)
