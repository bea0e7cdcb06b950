"""What a wiring fault is in a plain sentence, and what to do about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gsl.diagnosis.wiring.fault import ACTION, BOTH, POSITION, Fault

LISTED = 6  # joints that a sentence names
WHO = {ACTION: "the commands of", POSITION: "the positions of", BOTH: "commands and positions of"}
UNITS: Mapping[str, str] = {"deg": "degrees", "turn": "turns", "mrad": "milliradians", "%": "hundredths of a radian"}
OF_SLIDES: Mapping[str, str] = {"mrad": "millimetres", "%": "centimetres"}  # what the same factor is of a slide
IN_A_MAPPING: Mapping[str, str] = {"mrad": "mm"}  # and how a mapping says that


class Channels(NamedTuple):
    """What sentences say of a log.

    Attributes:
        joints: Their names.
        period: Control period [s].
        levers: Of the joints, see `Joint.lever`: not 1 of those that slide.
    """

    joints: tuple[str, ...]
    period: float
    levers: tuple[float, ...]

    def slides(self, fault: Fault) -> list[bool]:
        """Return which of the joints of a fault slide."""
        return [self.levers[k] != 1.0 for k in fault.joints]


def describe(fault: Fault, log: Channels) -> str:
    """Return what is wrong with a log, in a sentence."""
    sentence: str = {
        "permuted": _say_permutation, "sign": _sign, "scale": _scale, "offset": _offset, "gains": _gains, "rate": _rate,
        "hold": _hold, "shift": _shift,
    }[fault.kind](fault, log)  # fmt: skip
    return f"{sentence[0].upper()}{sentence[1:]}."


def remedy(fault: Fault, log: Channels) -> str:
    """Return what to do, with the words of a mapping where it has some."""
    names = [log.joints[k] for k in fault.joints]
    signs = ", ".join(f"{name}: -1" for name in names)
    units = {
        IN_A_MAPPING.get(fault.value["unit"]) if slides else fault.value["unit"]
        for slides in log.slides(fault)
        if "unit" in fault.value
    }
    unit = (
        f"Say unit: {' or '.join(sorted(map(str, units)))}"
        if units - {None} == units != set()
        else "Say factor and offset"
    )
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


def _say_permutation(fault: Fault, log: Channels) -> str:
    order = fault.value["order"]
    places = [f"{log.joints[order[k]]} holds {log.joints[k]}" for k in fault.joints[:LISTED]]
    more = f" and {len(fault.joints) - LISTED} more" if len(fault.joints) > LISTED else ""
    what = {ACTION: "commands", POSITION: "positions", BOTH: "commands and positions"}[fault.side]
    return f"{what} of joints are exchanged: {', '.join(places)}{more}"


def _sign(fault: Fault, log: Channels) -> str:
    return f"{WHO[fault.side]} {list_joints(fault, log.joints)} have the other sign"


def _scale(fault: Fault, log: Channels) -> str:
    who = f"{WHO[fault.side]} {list_joints(fault, log.joints)}"
    if "unit" in fault.value:
        unit = str(fault.value["unit"])
        names = {OF_SLIDES.get(unit, unit) if slides else UNITS.get(unit, unit) for slides in log.slides(fault)}
        return f"{who} are in {' or '.join(sorted(names))}, {_instead(fault, log)}"
    if "range" in fault.value:
        return f"{who} are on a scale of {fault.value['range']} over the joint's range, {_instead(fault, log)}"
    factor = float(np.median(np.array(fault.value["factor"])[list(fault.joints)]))
    return f"{who} are {factor:.3g} times as large as they should be"


def _instead(fault: Fault, log: Channels) -> str:
    slides = log.slides(fault)
    return "not in metres" if all(slides) else "not in radians and metres" if any(slides) else "not in radians"


def _offset(fault: Fault, log: Channels) -> str:
    slides = np.array(log.slides(fault))
    offsets = (np.array(fault.value["offset"]) * log.levers)[list(fault.joints)]
    parts = [(offsets[slides == kind], unit) for kind, unit in ((False, "rad"), (True, "m")) if kind in slides]
    sizes = " and ".join(_range(part, unit) for part, unit in parts)
    return f"{WHO[fault.side]} {list_joints(fault, log.joints)} are off by {sizes}, as if relative to a default pose"


def _range(sizes: np.ndarray, unit: str) -> str:
    return f"{sizes[0]:+.2f} {unit}" if len(sizes) == 1 else f"{sizes.min():+.2f} to {sizes.max():+.2f} {unit}"


def _gains(fault: Fault, log: Channels) -> str:
    kp, kd = (float(np.median(fault.value[name])) for name in ("kp", "kd"))
    who = list_joints(fault, log.joints)
    return f"the simulator's gains of {who} are not the robot's, which moves as with kp × {kp:.3g} and kd × {kd:.3g}"


def _rate(fault: Fault, log: Channels) -> str:
    true = 1e3 * log.period * float(fault.value["factor"])
    return f"rows are {true:.4g} ms apart, and not {1e3 * log.period:.4g} ms as the log says"


def _hold(fault: Fault, log: Channels) -> str:
    ticks = int(fault.value["ticks"])
    every = {2: "second", 3: "third"}.get(ticks, f"{ticks}th")
    return f"{list_joints(fault, log.joints)} take every {every} command only, and hold it"


def _shift(fault: Fault, log: Channels) -> str:
    rows = -int(fault.value["rows"])
    early = f"{rows} row{'s' * (rows > 1)}"
    return f"the commands of {list_joints(fault, log.joints)} act {early} before the row that they are written in"
