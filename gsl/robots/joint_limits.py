"""When the limits of a joint say something, and when they are placeholders: missing, 0, or more than any joint has."""

from __future__ import annotations

from collections.abc import Mapping

from gsl.core.body import Joint

ENDS = ("lower", "upper")  # of a range
PLACEHOLDERS = {False: {"effort": 1e4, "velocity": 1e3}, True: {"effort": 1e6, "velocity": 1e2}}
"""What no joint of a robot reaches: [N·m], [rad/s] of those that turn; [N], [m/s] of those that slide."""
BOUNDLESS = {False: 1e3, True: 1e2}  # an end of a range beyond this stands for none [rad], or [m] of a slide
FREE = 1e6
"""End of what can turn on and on [rad]: a wheel of a vehicle turns as far in ten hours at 28 rad/s."""
MEANING = {
    False: {"effort": "peak torque [N·m]", "velocity": "speed without load [rad/s]"},
    True: {"effort": "peak force [N]", "velocity": "speed without load [m/s]"},
}


def is_limit(key: str, value: float, *, slides: bool) -> bool:
    """Whether a torque, force or speed is that of a motor."""
    return 0.0 < value < PLACEHOLDERS[slides][key]


def is_range(limit: Mapping[str, float], *, slides: bool) -> bool:
    """Whether a range says where a joint can move."""
    far = BOUNDLESS[slides]
    return {*ENDS} <= set(limit) and -far < limit["lower"] < limit["upper"] < far


def is_endless(joint: Joint) -> bool:
    """Whether a joint turns on and on."""
    return joint.upper - joint.lower > FREE


def limits_problem(limit: Mapping[str, float], *, slides: bool) -> str:
    """Return what is wrong with the limits of a driven joint and what to do, nothing if all is well."""
    missing = [key for key in MEANING[slides] if not is_limit(key, limit.get(key, 0.0), slides=slides)]
    if missing:
        lacks = [f"no {key}" if key not in limit else f"{key} {limit[key]:g}, a placeholder" for key in missing]
        what, typed = [MEANING[slides][key] for key in missing], " ".join(f"{key}=..." for key in missing)
        advice = f"write its motor's {' and '.join(what)} in <limit>, or in a robot file (gsl init ... {typed})"
        return f"has {' and '.join(lacks)}; {advice}"
    if is_range(limit, slides=slides):
        return ""
    unit = "m" if slides else "rad"
    if lacking := [key for key in ENDS if key not in limit]:
        has = "has no range" if len(lacking) == 2 else f"has no {lacking[0]}"
    else:
        has = f"its limits are {limit['lower']:g} and {limit['upper']:g} {unit}"
        has += ", a placeholder" if limit["lower"] < limit["upper"] else ": it could not move"
    return f"{has}; write lower and upper [{unit}] in <limit>, or in a robot file (gsl init ... lower=... upper=...)"
