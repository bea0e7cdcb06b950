"""Series at other times: tops of fast motions stay, and what no spline goes through is joined by chords."""

import numpy as np
import pytest

from gsl.core.series import interpolate


def test_a_jittering_clock_takes_nothing_off_a_fast_motion() -> None:
    times = 0.02 * np.arange(200)
    stamps = times + 0.004 * np.random.default_rng(0).uniform(-1.0, 1.0, len(times))
    motion, inside = 0.2 * np.sin(20.0 * stamps)[:, None], times[4:-4]
    assert np.abs(interpolate(stamps, motion, inside)[:, 0] - 0.2 * np.sin(20.0 * inside)).max() < 1e-4
    assert np.abs(np.interp(inside, stamps, motion[:, 0]) - 0.2 * np.sin(20.0 * inside)).max() > 3e-3


@pytest.mark.parametrize("stamps", [[0.0, 1.0, 2.0], [0.0, 1.0, 1.0, 2.0, 3.0]], ids=["few rows", "a stamp twice"])
def test_chords_join_what_no_spline_goes_through(stamps: list[float]) -> None:
    values = np.array(stamps) ** 2
    assert interpolate(np.array(stamps), values[:, None], np.array([0.5, 9.0]))[:, 0].tolist() == [0.5, values[-1]]


def test_a_hole_of_one_column_stays_there() -> None:
    stamps = np.arange(6.0)
    holed = np.where(stamps == 4.0, np.nan, stamps)
    made = interpolate(stamps, np.column_stack([stamps, holed]), np.array([0.5, 3.5]))
    assert made[:, 0] == pytest.approx([0.5, 3.5])
    assert made[0, 1] == 0.5 and np.isnan(made[1, 1])
