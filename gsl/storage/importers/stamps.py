"""The stamps of a log in seconds, and what is wrong with clocks: holes, jumps back, the same stamp twice."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsl.errors import TrajectoryError
from gsl.storage.importers.signal import Time
from gsl.storage.importers.units import factor

COUNTERS = (2.0**16, 2.0**24, 2.0**31, 2.0**32)  # where whole numbers of a clock begin again
NEAR = 20.0  # steps between rows, by which a jump back may differ from that
COARSE = 0.1  # share of the rows that repeat a stamp, above which it is no accident


def seconds(path: Path, stamps: np.ndarray, time: Time, column: str) -> np.ndarray:
    """Return stamps in seconds, shape (T,).

    Raises:
        TrajectoryError: They are no numbers, or texts that are no dates.
    """
    if time.period is not None:
        return stamps
    if stamps.dtype.kind == "M" or time.unit == "iso":
        return _dates(path, stamps, column)
    if stamps.dtype.kind not in "uif" or stamps.ndim != 1:
        problem = "holds no numbers; dates in words are time: {unit: iso}"
        raise TrajectoryError(path, problem, column=column)
    rising = stamps.astype(np.float64)
    if time.wrap is not None:
        rising = rising + time.wrap * np.cumsum(np.diff(rising, prepend=rising[:1]) < -0.5 * time.wrap)
    return rising * factor(time.unit, "s")


def _dates(path: Path, stamps: np.ndarray, column: str) -> np.ndarray:
    try:
        words = stamps if stamps.dtype.kind == "M" else np.array([str(stamp).removesuffix("Z") for stamp in stamps])
        return words.astype("datetime64[ns]").astype(np.int64).astype(np.float64) * 1e-9
    except ValueError as error:
        raise TrajectoryError(path, f"holds no dates: {error}", column=column) from error


def order_rows(
    path: Path, stamps: np.ndarray, column: str, rows: np.ndarray, *, drop: bool, unit: str = "s"
) -> np.ndarray:
    """Return which rows to keep, shape (T,): all, or without those whose stamp has just been there.

    Args:
        path: For errors.
        stamps: In seconds, shape (T,).
        column: For errors.
        rows: Numbers of the rows in the file, shape (T,).
        drop: Leave repeated stamps out instead of refusing them.
        unit: Of the stamps in the file.

    Raises:
        TrajectoryError: A stamp is no number, the clock jumps back, or a stamp comes twice.
    """
    keep = np.ones(len(stamps), dtype=bool)
    if not np.isfinite(stamps).all():
        wrong = int(rows[np.argmin(np.isfinite(stamps))])
        raise TrajectoryError(path, "is not a finite number; drop or mend the row", column=column, row=wrong)
    steps = np.diff(stamps)
    if (steps < 0.0).any():
        at, times = int(np.argmax(steps < 0.0)) + 1, int((steps < 0.0).sum())
        many = f" ({times} times in all)" if times > 1 else ""
        again = stamps[at] != stamps[0] and stamps[at] in stamps[:at]
        repeated = "these stamps were there before: drop the rows that repeat, or cut the file there"
        advice = repeated if again else "cut the file there, or sort its rows"
        if (top := _find_wrap(steps, unit)) is not None:
            advice = f"a counter that begins again? mapping.time.wrap={top:.12g} says so"
        problem = f"the clock jumps back by {-steps[at - 1]:.4g} s{many}; {advice}"
        raise TrajectoryError(path, problem, column=column, row=int(rows[at]))
    keep[1:] = steps > 0.0
    if not (drop or keep.all()):
        at, twice = int(np.argmin(keep)), int((~keep).sum())
        problem = f"the stamp of the row before again ({twice} such rows); {_advise(stamps, twice)}"
        raise TrajectoryError(path, problem, column=column, row=int(rows[at]))
    return keep


def _find_wrap(steps: np.ndarray, unit: str) -> float | None:
    """Return what a clock counted to before it jumped back, in the unit of the file; None if it is no counter.

    Args:
        steps: From one stamp to the next [s], shape (T - 1,).
        unit: Of the stamps in the file.
    """
    own = factor(unit, "s") if unit != "iso" else 1.0
    backs, on = -steps[steps < 0.0], steps[steps >= 0.0]
    back, usual = float(backs.max()), float(np.median(on)) if len(on) else 0.0
    if np.ptp(backs) > NEAR * usual:  # rows in disorder jump back by this and that
        return None
    for tick in dict.fromkeys((own, 1e-3, 1e-6, 1e-9)):
        for top in COUNTERS:
            if 0.0 <= top * tick - back <= NEAR * usual:
                return top * tick / own
    return None


def _advise(stamps: np.ndarray, twice: int) -> str:
    """Return what to do about repeated stamps; where there are many, the rows are right and the clock is coarse."""
    if twice <= COARSE * len(stamps):
        return "mapping.duplicates=drop leaves them out"
    changes = np.flatnonzero(np.diff(stamps) > 0.0) + 1  # before the first and after the last a tick is cut off
    changes = changes if len(changes) > 1 else np.array([0, len(stamps) - 1])
    period = float(stamps[changes[-1]] - stamps[changes[0]]) / int(changes[-1] - changes[0])
    even = f"mapping.time.period={period:.4g} if they are evenly spaced" if period > 0.0 else "log a clock that runs"
    return f"the clock is too coarse for so many rows: log finer stamps, or say {even}"
