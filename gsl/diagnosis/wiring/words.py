"""What a wiring fault is in a plain sentence, and what to do about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gsl.diagnosis.wiring.fault import ACTION, BOTH, POSITION, Fault

LISTED = 6  # joints that a sentence names
WHO = {ACTION: "the commands of", POSITION: "the positions of", BOTH: "commands and positions of"}
UNITS: Mapping[str, str] = {"deg": "degrees", "turn": "turns", "mrad": "milliradians", "%": "hundredths of a radian"}


def describe(fault: Fault, joints: Sequence[str], period: float) -> str:
    """Return what is wrong, in a sentence.

    Args:
        fault: To describe.
        joints: Names of the log's joints.
        period: Control period of the log [s].
    """
    sentence: str = {
        "permuted": _say_permutation, "sign": _sign, "scale": _scale, "offset": _offset, "gains": _gains, "rate": _rate,
        "hold": _hold, "shift": _shift,
    }[fault.kind](fault, joints, period)  # fmt: skip
    return f"{sentence[0].upper()}{sentence[1:]}."


def remedy(fault: Fault, joints: Sequence[str]) -> str:
    """Return what to do, with the words of a mapping where it has some.

    Args:
        fault: To mend.
        joints: Names of the log's joints.
    """
    names = [joints[k] for k in fault.joints]
    signs = ", ".join(f"{name}: -1" for name in names)
    unit = f"Say unit: {fault.value['unit']}" if "unit" in fault.value else "Say factor and offset"
    signal = "action" if fault.side == ACTION else "position" if fault.side == POSITION else "action and position"
    return {
        "permuted": "Name the columns of these joints anew in the mapping.",
        "sign": f"Say sign: {{{signs}}} for {signal} in the mapping.",
        "scale": f"{unit} for {signal} in the mapping.",
        "offset": f"Say the offset of these joints for {signal} in the mapping.",
        "gains": "Give the simulator the robot's gains (sim.effects.servo_gain), and look at their units.",
        "rate": "Say the true rate: the unit of time, or its period, in the mapping.",
        "hold": "Log the commands that the robot takes, or let it take all of them.",
        "shift": "Write a command into the row whose state was measured before it.",
    }[fault.kind]


def list_joints(fault: Fault, joints: Sequence[str]) -> str:
    """Return the joints of a fault in words."""
    names = [joints[k] for k in fault.joints]
    if len(names) == len(joints) > 1:
        return "all joints"
    shown = names[:LISTED]
    more = [f"{len(names) - LISTED} more"] if len(names) > LISTED else []
    *most, last = [*shown, *more]
    return f"{', '.join(most)} and {last}" if most else last


def _say_permutation(fault: Fault, joints: Sequence[str], period: float) -> str:
    order = fault.value["order"]
    places = [f"{joints[order[k]]} holds {joints[k]}" for k in fault.joints[:LISTED]]
    more = f" and {len(fault.joints) - LISTED} more" if len(fault.joints) > LISTED else ""
    what = {ACTION: "commands", POSITION: "positions", BOTH: "commands and positions"}[fault.side]
    return f"{what} of joints are exchanged: {', '.join(places)}{more}"


def _sign(fault: Fault, joints: Sequence[str], period: float) -> str:
    return f"{WHO[fault.side]} {list_joints(fault, joints)} have the other sign"


def _scale(fault: Fault, joints: Sequence[str], period: float) -> str:
    who = f"{WHO[fault.side]} {list_joints(fault, joints)}"
    if "unit" in fault.value:
        unit = str(fault.value["unit"])
        return f"{who} are in {UNITS.get(unit, unit)}, not in radians"
    if "range" in fault.value:
        return f"{who} are on a scale of {fault.value['range']} over the joint's range, not in radians"
    factor = float(np.median(np.array(fault.value["factor"])[list(fault.joints)]))
    return f"{who} are {factor:.3g} times as large as they should be"


def _offset(fault: Fault, joints: Sequence[str], period: float) -> str:
    offsets = np.array(fault.value["offset"])[list(fault.joints)]
    sizes = f"{offsets[0]:+.2f} rad" if len(offsets) == 1 else f"{offsets.min():+.2f} to {offsets.max():+.2f} rad"
    return f"{WHO[fault.side]} {list_joints(fault, joints)} are off by {sizes}, as if relative to a default pose"


def _gains(fault: Fault, joints: Sequence[str], period: float) -> str:
    kp, kd = (float(np.median(fault.value[name])) for name in ("kp", "kd"))
    who = list_joints(fault, joints)
    return f"the simulator's gains of {who} are not the robot's, which moves as with kp × {kp:.3g} and kd × {kd:.3g}"


def _rate(fault: Fault, joints: Sequence[str], period: float) -> str:
    true = 1e3 * period * float(fault.value["factor"])
    return f"rows are {true:.4g} ms apart, and not {1e3 * period:.4g} ms as the log says"


def _hold(fault: Fault, joints: Sequence[str], period: float) -> str:
    ticks = int(fault.value["ticks"])
    every = {2: "second", 3: "third"}.get(ticks, f"{ticks}th")
    return f"{list_joints(fault, joints)} take every {every} command only, and hold it"


def _shift(fault: Fault, joints: Sequence[str], period: float) -> str:
    rows = -int(fault.value["rows"])
    early = f"{rows} row{'s' * (rows > 1)}"
    return f"the commands of {list_joints(fault, joints)} act {early} before the row that they are written in"
