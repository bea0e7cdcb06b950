"""When the limits of a joint say something, and when they are placeholders: missing, 0, or more than any joint has."""

from __future__ import annotations

from collections.abc import Mapping

PLACEHOLDERS = {"effort": 1e4, "velocity": 1e3}  # [N·m], [rad/s]: no joint of a robot has as much
BOUNDLESS = 1e3  # an end of a range beyond this stands for none [rad]
MEANING = {"effort": "peak torque [N·m]", "velocity": "speed without load [rad/s]"}


def is_limit(key: str, value: float) -> bool:
    """Whether a torque or speed is that of a motor."""
    return 0.0 < value < PLACEHOLDERS[key]


def is_range(limit: Mapping[str, float]) -> bool:
    """Whether a range says where a joint can move [rad]."""
    return -BOUNDLESS < limit.get("lower", 0.0) < limit.get("upper", 0.0) < BOUNDLESS


def limits_problem(limit: Mapping[str, float]) -> str:
    """Return what is wrong with the limits of a driven joint and what to do, nothing if all is well."""
    for key, what in MEANING.items():
        if not is_limit(key, limit.get(key, 0.0)):
            has = f"has no {key}" if key not in limit else f"has {key} {limit[key]:g}, a placeholder"
            return f"{has}; write its motor's {what} in <limit>, or in a robot file (gsl init ... {key}=...)"
    if is_range(limit):
        return ""
    lower, upper = limit.get("lower", 0.0), limit.get("upper", 0.0)
    has = f"its limits are {lower:g} and {upper:g} rad"
    has += ", a placeholder" if lower < upper else ": it could not move"
    has = has if {"lower", "upper"} & set(limit) else "has no range"
    return f"{has}; write lower and upper [rad] in <limit>, or in a robot file (gsl init ... lower=... upper=...)"
