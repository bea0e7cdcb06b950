"""A signal of a foreign log: where it is, in which unit, with which sign and zero; and the stamps of its rows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np

from gsl.core.other_commands import OTHER_COMMANDS
from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.storage.importers.units import factor
from gsl.storage.trajectory_contract import SHORTEST

Columns = str | int | list[str | int] | dict[str, str | int]
Values = float | dict[str, float]

BESIDE = (*OTHER_COMMANDS, "kp_command", "kd_command")  # of a servo that takes more than a position
PER_JOINT = ("action", "grounded_action", "position", "velocity", "torque", "temperature", *BESIDE)
COMMANDS = ("action", "grounded_action")
NEEDED = ("action", "position")  # of every log
FLAGS = ("enabled",)
AXES: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(("gyro", "acceleration", "base.position", "base.velocity"), ("x", "y", "z")),
    "base.orientation": ("x", "y", "z", "w"),
    "foot_force": ("left", "right"),
}
BY_NAME = ("column", "unit", "sign", "factor", "zero", "offset")  # what may differ by joint or by axis
KNOWN = (*PER_JOINT, "voltage", *FLAGS, *AXES)


@component
class Time:
    """The stamps of the rows, in each file or topic."""

    column: Annotated[str, setting("column, path or key of the stamps", min_length=1)] = "time"
    unit: Annotated[str, setting("s, ms, us or ns; iso for dates in words")] = "s"
    wrap: Annotated[
        float | None, setting("what the stamps count to before they begin again, such as 4294967296", gt=0)
    ] = None
    period: Annotated[
        float | None, setting("instead of stamps: time from one row to the next", unit="s", ge=SHORTEST)
    ] = None

    def __post_init__(self) -> None:
        """Refuse a unit that is none of time."""
        check_time_unit("unit", self.unit)


@component
class Signal:
    """One signal: value = sign * factor * unit * (raw - zero) + offset; by joint or axis: {knee: -1}."""

    column: Annotated[
        Columns, setting("column, path or key; {joint} stands for a joint's old name, [3] takes one entry")
    ]
    file: Annotated[str, setting("which of `files` it is in, or the topic of a bag")] = ""
    unit: Annotated[str | dict[str, str], setting("unit in the log; that of the contract if none")] = ""
    bits: Annotated[
        int, setting("of a signed whole number that was logged without its sign, such as 16", ge=0, le=64)
    ] = 0
    sign: Annotated[Values, setting("1 or -1")] = 1.0
    factor: Annotated[Values, setting("what one raw unit is in `unit`")] = 1.0
    zero: Annotated[Values, setting("raw value at the contract's zero")] = 0.0
    offset: Annotated[Values, setting("added in the end, in the contract's unit")] = 0.0
    time: Annotated[str, setting("column of its own stamps, if they are not those of `time`")] = ""
    optional: Annotated[bool, setting("leave it out where a file lacks it")] = False

    def __post_init__(self) -> None:
        """Refuse a sign that is none."""
        signs = self.sign.values() if isinstance(self.sign, dict) else [self.sign]
        if any(abs(sign) != 1.0 for sign in signs):
            raise ConfigError("sign", "must be 1 or -1; a scale is factor", given=str(self.sign))

    def apply_sign(self, raw: np.ndarray) -> np.ndarray:
        """Return raw values with the sign that the upper half of the numbers of `bits` stands for."""
        turn = 2.0**self.bits
        return np.where(raw >= turn / 2.0, raw - turn, raw) if self.bits else raw

    def scale(self, joint: str, wanted: str | None) -> tuple[float, float]:
        """Return gain and offset of a joint's or an axis's raw values, in the unit `wanted` or, if none, its own."""
        unit = _of(self.unit, joint, "")
        size = factor(unit, wanted) if unit and wanted else 1.0
        gain = _of(self.sign, joint, 1.0) * _of(self.factor, joint, 1.0) * size
        return gain, _of(self.offset, joint, 0.0) - gain * _of(self.zero, joint, 0.0)


def check_time_unit(where: str, unit: str) -> None:
    """Refuse what is no unit of time."""
    try:
        factor(unit, "s") if unit != "iso" else None
    except ValueError as error:
        raise ConfigError(where, f"{error}, iso", given=unit) from error


def _of(values: Any, joint: str, default: Any) -> Any:
    return values.get(joint, default) if isinstance(values, dict) else values
