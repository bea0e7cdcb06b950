"""How far, how fast and how abruptly targets may go: what a request allows and what the robot's own file allows.

The narrower of the two counts. A request's limits are refused where they are none: not finite, or beyond any robot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from gsl.runner.senses import RobotError

NAME = "LIMITS"  # in a robot's file: for every joint lower, upper [rad] and, if it is known, speed [rad/s]
FARTHEST, FASTEST = 100.0, 1e3  # [rad], [rad/s]: no joint goes further from 0, or faster
ENDLESS = 1e300  # numbers beyond are none; whole ones of Python may be
JUMP = 0.5  # of the way that the speed allows in a window, the most in one step: gsl asks for no more
_ROUNDING = 1e-6


def limits_problem(limits: Mapping[str, Any], joints: Sequence[str], period: float) -> str:
    """Return why limits are none that could guard a robot, nothing if they are.

    Args:
        limits: `lower`, `upper`, `step`, `path` [rad], `speed` [rad/s], one value a joint, and `window` [s].
        joints: Names.
        period: Control period [s].
    """
    window: Any = limits.get("window")
    if not _is_number(window) or not 0.0 < window <= 1.0:
        return f"limits.window is {window!r}, not between 0 and 1 s"
    names = ("lower", "upper", "speed", "path", "step")
    for name in names:
        values = limits.get(name)
        if not isinstance(values, list) or len(values) != len(joints) or not all(map(_is_number, values)):
            return f"limits.{name} must be {len(joints)} finite numbers, one a joint"
    for joint, *values in zip(joints, *(limits[name] for name in names), strict=True):
        lower, upper, speed, path, step = values
        if not -FARTHEST <= lower < upper <= FARTHEST:
            return f"{joint}: limits of {lower:.4g} and {upper:.4g} rad are those of no joint"
        if not 0.0 < speed <= FASTEST:
            return f"{joint}: a speed limit of {speed:g} rad/s is that of no joint"
        far = speed * window * (1.0 + _ROUNDING)
        if not (0.0 < path <= far and 0.0 < step <= max(JUMP * far, speed * period * (1.0 + _ROUNDING))):
            return f"{joint}: a step of {step:.4g} rad or a way of {path:.4g} rad is more than its speed limit allows"
    return ""


def narrowest(limits: Mapping[str, Any], joints: Sequence[str], robot: Any) -> dict[str, Any]:
    """Return the limits of a request, no wider than those that a robot's own file says.

    Raises:
        RobotError: The file's limits are damaged, lack a joint, or have nothing in common with the request's.
    """
    own = getattr(robot, NAME, None)
    if own is None:
        return dict(limits)
    if not isinstance(own, Mapping) or (strange := [name for name in own if name not in joints]):
        what = f"names {strange[0]!r}, which the request does not" if isinstance(own, Mapping) else "is no dictionary"
        raise RobotError(f"{NAME} of the robot's file {what}; it maps joints to lower, upper [rad], speed [rad/s]")
    narrow = {name: list(values) if isinstance(values, list) else values for name, values in limits.items()}
    for index, joint in enumerate(joints):
        lower, upper, speed = _own(joint, own.get(joint))
        narrow["lower"][index] = max(limits["lower"][index], lower)
        narrow["upper"][index] = min(limits["upper"][index], upper)
        share = min(1.0, speed / limits["speed"][index])
        for name in ("speed", "path", "step"):
            narrow[name][index] = share * limits[name][index]
        if not narrow["lower"][index] < narrow["upper"][index]:
            raise RobotError(f"{NAME} of the robot's file: {joint} has no range in common with the request's limits")
    return narrow


def _own(joint: str, values: Any) -> tuple[float, float, float]:
    numbers = list(values) if isinstance(values, Sequence) and not isinstance(values, str) else []
    if len(numbers) not in (2, 3) or not all(map(_is_number, numbers)):
        raise RobotError(f"{NAME} of the robot's file: {joint} needs finite lower, upper [rad] and speed [rad/s]")
    lower, upper, speed = (*numbers, math.inf)[:3]
    if not (lower < upper and speed > 0.0):
        raise RobotError(f"{NAME} of the robot's file: {joint} could not move with {lower:g}, {upper:g}, {speed:g}")
    return lower, upper, speed


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < ENDLESS
