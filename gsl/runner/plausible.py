"""Whether a request says something that can be done: finite numbers, limits that guard, ramps that are slow.

Its hash only says that nothing was changed on the way; anybody can write one with whatever numbers he likes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from gsl.core.layout import SUFFIXES
from gsl.runner.bounds import ENDLESS, limits_problem

SHORTEST, SLOWEST = 1e-4, 0.1  # control period [s]; no servo takes 10,000 targets a second
RAMP = {"seconds": (1.0, 60.0), "speed": (0.0, 2.0), "within": (0.0, 1.0)}  # [s], [rad/s], [rad], as world=robot takes
LONGEST = 1_000_000  # steps of an episode: hours
TEXTS, FLAGS = ("about", "robot", "place"), ("distance", "until_fall")


def request_problem(request: Mapping[str, Any]) -> str:
    """Return what a request says that cannot be meant, nothing if all of it can."""
    try:
        return next(_problems(request), "")
    except (KeyError, TypeError, AttributeError, ValueError, OverflowError) as error:
        return f"lacks a part or has one of another kind ({type(error).__name__}: {error})"


def _problems(request: Mapping[str, Any]) -> Iterator[str]:
    yield from (f"{place} is {str(value)[:20]}, not a finite number" for place, value in _endless(request, ""))
    joints, period = request["joints"], request["control_period"]
    if not joints or len(set(joints)) != len(joints) or not all(isinstance(joint, str) for joint in joints):
        yield "joints must be different names"
    if not SHORTEST <= period <= SLOWEST:
        yield f"control_period is {period:g} s, not between {SHORTEST:g} and {SLOWEST:g} s"
    yield from _parts(request, len(joints))
    if problem := limits_problem(request["limits"], joints, period):
        yield problem
    for name, (least, most) in RAMP.items():
        if not max(least, 1e-9) <= request["ramp"][name] <= most:
            yield f"ramp.{name} is {request['ramp'][name]:g}, not between {least:g} and {most:g}"
    if not 0.0 <= request["action_noise"] <= math.pi:
        yield f"action_noise is {request['action_noise']:g} rad"
    names = [episode["name"] for episode in request["episodes"]]
    if not names or len(set(names)) != len(names) or not all(isinstance(name, str) and name for name in names):
        yield "episodes must have different names"
    for episode in request["episodes"]:
        yield from (f"{episode['name']}: {problem}" for problem in _episode(episode, len(joints)))


def _parts(request: Mapping[str, Any], joints: int) -> Iterator[str]:
    """Yield which of the parts that are taken as they are is of another kind."""
    for name, kind in {**dict.fromkeys(TEXTS, str), **dict.fromkeys(FLAGS, bool)}.items():
        if not isinstance(request[name], kind):
            yield f"{name} must be {'a text' if kind is str else 'true or false'}"
    if not isinstance(request["policy"], Mapping):
        yield "policy must be settings by name"
    observes = request["observes"]
    for part, size in observes.items():
        due = (joints,) if part in ("position", "velocity") else SUFFIXES
        if type(size) is not int or size not in due:
            yield f"observes.{part} is {str(size)[:20]}, not {' or '.join(map(str, due))} numbers"
    if "position" not in observes:
        yield "observes has no position"


def _episode(episode: Mapping[str, Any], joints: int) -> Iterator[str]:
    if not isinstance(episode["policy"], str):
        yield "policy must be a name"
    parameters = episode["parameters"]
    if not (isinstance(parameters, list) and _is_row(parameters, len(parameters))):
        yield "parameters must be numbers"
    steps = episode["steps"]
    if not isinstance(steps, int) or not 0 < steps <= LONGEST:
        yield f"steps is {steps!r}, not a whole number from 1 on"
    if not _is_row(episode["posture"], joints):
        yield f"posture must be {joints} numbers, one a joint"
    if not isinstance(episode["seed"], int) or episode["seed"] < 0:
        yield f"seed is {episode['seed']!r}, not a whole number from 0 on"
    table = episode.get("commands")
    if table is not None and not (table and all(_is_row(row, joints) for row in table)):
        yield f"commands must be rows of {joints} numbers, one a joint"


def _is_row(values: Any, count: int) -> bool:
    return isinstance(values, list) and len(values) == count and all(type(value) in (int, float) for value in values)


def _endless(value: Any, place: str) -> Iterator[tuple[str, float]]:
    """Yield the numbers in a document that are not finite, with their places."""
    if isinstance(value, int | float) and not abs(value) < ENDLESS:
        yield place, value
    elif isinstance(value, Mapping):
        for key, entry in value.items():
            yield from _endless(entry, f"{place}.{key}" if place else str(key))
    elif isinstance(value, list):
        for number, entry in enumerate(value):
            yield from _endless(entry, f"{place}[{number}]")
