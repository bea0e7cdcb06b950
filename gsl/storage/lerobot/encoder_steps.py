"""Which scale the angles of a data set are on, read off the steps of its encoders.

LeRobot logs a measured angle either in degrees or as a percentage of the joint's calibrated range, and does not log
which. Both are whole encoder ticks before they are scaled (lerobot/motors/motors_bus.py, `_normalize`):

    degrees      v = 360 (tick - middle) / 4095         steps of 0.0879, whole or half ones from 0
    percentage   v = 200 (tick - lowest) / range - 100  steps of 200 / range from -100, range a whole number of ticks

So values that all lie on one of these combs say which it is, and a percentage says its range.
"""

from __future__ import annotations

import numpy as np

TURN = 4095.0  # ticks that LeRobot counts to a turn
STEP = 360.0 / TURN  # [degrees]
RANGES = np.arange(200, 4096)  # ticks that a joint may be calibrated over
ENOUGH, MOST = 30, 400  # different values: fewer fit some comb by chance, more add nothing
DECIMALS = 1000.0  # of a unit: ranges on whose comb all numbers of three decimals lie tell no encoder
OFF = 0.02  # of a step by which a value may be off; 32-bit numbers are off by 0.0002 at most


def on_degrees(values: np.ndarray) -> bool | None:
    """Tell whether measured angles are whole or half encoder steps in degrees; None if there are too few to tell."""
    some = _pick(values)
    if some is None:
        return None
    halves = some / (0.5 * STEP)
    return bool(np.abs(halves - np.round(halves)).max() < OFF)


def find_range(values: np.ndarray, lowest: float) -> int | None:
    """Return the calibrated range of a joint that is logged as a percentage [ticks], None if it cannot be told.

    Args:
        values: Measured, shape (T,).
        lowest: Value at the lower end of the range: -100, or 0 of a gripper.
    """
    some = _pick(values)
    if some is None or some.min() < lowest - OFF or some.max() > 100.0 + OFF:
        return None
    ticks = (some[None, :] - lowest) * (RANGES[:, None] / (100.0 - lowest))
    fitting = RANGES[np.abs(ticks - np.round(ticks)).max(axis=1) < OFF]
    return int(fitting[0]) if len(fitting) else None


def is_telling(ticks: int) -> bool:
    """Tell whether the steps of a range are an encoder's: degrees that were rounded to 0.1 lie on those of 2000."""
    return bool(200.0 * DECIMALS % ticks)


def _pick(values: np.ndarray) -> np.ndarray | None:
    different = np.unique(values[np.isfinite(values)])
    if len(different) < ENOUGH:
        return None
    return different[np.linspace(0, len(different) - 1, min(len(different), MOST)).astype(int)].astype(np.float64)
