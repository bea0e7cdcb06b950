"""Units of foreign logs: what one of them is in the SI unit of the trajectory contract."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from gsl.core.validation import did_you_mean

DEGREE, TURN, GRAVITY = math.pi / 180.0, 2.0 * math.pi, 9.80665
_ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE, "turn": TURN}
_WAYS = {"m": 1.0, "mm": 1e-3}  # the contract has m for rad, and N for N·m, of joints that slide
FACTORS: Mapping[str, Mapping[str, float]] = {
    "rad": {**_ANGLES, **_WAYS},
    "rad/s": {**{f"{name}/s": factor for name, factor in {**_ANGLES, **_WAYS}.items()}, "rpm": TURN / 60.0},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "N·m": {"Nm": 1.0, "mNm": 1e-3, "kgcm": GRAVITY / 100.0, "N": 1.0},
    "N·m/rad": {"Nm/rad": 1.0, "Nm/deg": 1.0 / DEGREE, "N/m": 1.0},
    "N·m·s/rad": {"Nms/rad": 1.0, "Nms/deg": 1.0 / DEGREE, "Ns/m": 1.0},
    "V": {"V": 1.0, "mV": 1e-3},
    "°C": {"degC": 1.0},
    "m/s²": {"m/s²": 1.0, "g": GRAVITY},
    "N": {"N": 1.0},
    "m": _WAYS,
    "m/s": {"m/s": 1.0, "mm/s": 1e-3},
    "1": {"1": 1.0},
}
"""SI unit of the contract -> unit of a log -> factor."""

_TICKS = re.compile(r"ticks/(\d{1,18})(/s)?")
_SPELLINGS = {
    **dict.fromkeys(("degrees", "degree", "deg.", "°"), "deg"),
    **dict.fromkeys(("°/s", "dps"), "deg/s"),
    **dict.fromkeys(("°C", "C"), "degC"),
    **{"radians": "rad", "m/s2": "m/s²", "rev": "turn", "rev/s": "turn/s", "sec": "s"},
}


def factor(unit: str, wanted: str) -> float:
    """Return what one `unit` is in the contract's unit `wanted`.

    `ticks/4096` is a 4096th of a turn, `ticks/4096/s` that every second.

    Raises:
        ValueError: There is no such unit of this quantity; the text says which there are.
    """
    name = _spell(unit)
    factors = FACTORS[wanted]
    if name in factors:
        return factors[name]
    ticks = _TICKS.fullmatch(name)
    if ticks and int(ticks.group(1)) and wanted == ("rad/s" if ticks.group(2) else "rad"):
        return TURN / int(ticks.group(1))
    more = {"rad": ["ticks/4096"], "rad/s": ["ticks/4096/s"]}.get(wanted, [])
    raise ValueError(f"is no unit for what is in {wanted}{did_you_mean(unit, [*factors, *more], listed=True)}")


def is_length(unit: str) -> bool:
    """Tell whether positions in this unit are those of a joint that slides."""
    return _spell(unit) in _WAYS


def _spell(unit: str) -> str:
    name = unit.replace("·", "").replace("*", "").replace(" ", "").replace("µ", "u").replace("μ", "u")
    name = name.replace("^2", "²")
    return _SPELLINGS.get(name, name)
