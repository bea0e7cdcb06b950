"""The stamps of a log in seconds, and what is wrong with clocks: holes, jumps back, the same stamp twice."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gsl.errors import TrajectoryError
from gsl.storage.importers.signal import Time
from gsl.storage.importers.units import factor


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
    return stamps.astype(np.float64) * factor(time.unit, "s")


def _dates(path: Path, stamps: np.ndarray, column: str) -> np.ndarray:
    try:
        words = stamps if stamps.dtype.kind == "M" else np.array([str(one).removesuffix("Z") for one in stamps])
        return words.astype("datetime64[ns]").astype(np.int64).astype(np.float64) * 1e-9
    except ValueError as error:
        raise TrajectoryError(path, f"holds no dates: {error}", column=column) from error


def order_rows(path: Path, stamps: np.ndarray, column: str, rows: np.ndarray, *, drop: bool) -> np.ndarray:
    """Return which rows to keep, shape (T,): all, or without those whose stamp has just been there.

    Args:
        path: For errors.
        stamps: In seconds, shape (T,).
        column: For errors.
        rows: Numbers of the rows in the file, shape (T,).
        drop: Leave repeated stamps out instead of refusing them.

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
        problem = f"the clock jumps back by {-steps[at - 1]:.4g} s{many}; {advice}"
        raise TrajectoryError(path, problem, column=column, row=int(rows[at]))
    keep[1:] = steps > 0.0
    if not (drop or keep.all()):
        at, twice = int(np.argmin(keep)), int((~keep).sum())
        problem = f"the stamp of the row before again ({twice} such rows); mapping.duplicates=drop leaves them out"
        raise TrajectoryError(path, problem, column=column, row=int(rows[at]))
    return keep
