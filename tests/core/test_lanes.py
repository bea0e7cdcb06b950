"""Lanes against numpy, lane by lane; sine and cosine against the C library's."""

import numpy as np
import pytest

from gsl.commandline.failure import describe_failure
from gsl.core.compiled import compile_kernel, describe_uncompilable
from gsl.core.lanes import LANES, side_by_side, where, zeros_in_lanes
from gsl.core.sine import sine_cosine


@compile_kernel
def _formulas(first: float, second: float, result: np.ndarray) -> None:
    result[0] = first + 2.0 * second - first / second
    result[1] = where(first > second, -first, min(1.0, second))
    result[2] = where(first < 0.0, max(first, second), abs(first))
    result[3] = np.rint(3.0 * first) + np.exp(second)
    total = 0.0
    for k in range(4):
        total += k * result[k]
    result[4] = total
    result[4] -= first
    result[4] *= where(first == second, 0.0, 2.0)
    result[5], result[6] = sine_cosine(20.0 * first)


@compile_kernel
def _in_lanes(numbers: np.ndarray, result: np.ndarray) -> None:
    columns = side_by_side(numbers)
    _formulas(columns[0], columns[1], side_by_side(result))


def test_every_lane_has_the_bits_of_a_float() -> None:
    numbers, result = np.random.default_rng(0).standard_normal((2, LANES)), np.zeros((7, LANES))
    numbers[1, 0] = numbers[0, 0]
    _in_lanes(numbers, result)
    for lane in range(LANES):
        single = np.zeros(7)
        _formulas(numbers[0, lane], numbers[1, lane], single)
        np.testing.assert_array_equal(result[:, lane], single)


@compile_kernel
def _functions(x: float, result: np.ndarray) -> None:
    result[0], result[1], result[2] = np.sin(x), np.cos(x), np.tan(x)
    result[3], result[4] = np.tanh(x), np.arctan(x)
    result[5], result[6] = np.sqrt(abs(x)), np.log(1.0 + np.abs(x))
    result[7], result[8], result[9] = x**2, x**3, np.sign(x)
    result[10], result[11] = where(x >= 0.0, 1.0, x), where((x <= 0.0) if False else x != 0.0, 1.0, x)


@compile_kernel
def _functions_in_lanes(numbers: np.ndarray, result: np.ndarray) -> None:
    _functions(side_by_side(numbers)[0], side_by_side(result))


def test_a_law_may_use_the_functions_of_numpy() -> None:
    numbers, result = np.random.default_rng(1).standard_normal((1, LANES)), np.zeros((12, LANES))
    numbers[0, :3] = 0.0, np.inf, np.nan
    _functions_in_lanes(numbers, result)
    for lane in range(LANES):
        single = np.zeros(12)
        _functions(numbers[0, lane], single)
        np.testing.assert_array_equal(result[:, lane], single)


def test_eight_never_lie_across_two_cache_lines() -> None:
    kept = [zeros_in_lanes(3, k) for k in range(1, 6)]
    assert all(array.shape == (3, k + 1, LANES) and not array.any() for k, array in enumerate(kept))
    assert all(array.ctypes.data % (8 * LANES) == 0 for array in kept)


def test_sine_and_cosine_are_those_of_the_c_library() -> None:
    angles = np.r_[np.linspace(-10.0, 10.0, 20001), np.linspace(-1e4, 1e4, 20001)]
    pairs = np.array([sine_cosine(angle) for angle in angles])
    np.testing.assert_allclose(pairs, np.column_stack([np.sin(angles), np.cos(angles)]), rtol=0.0, atol=3e-16)


@compile_kernel
def _choice(x: float, result: np.ndarray) -> None:
    result[0] = 2.0 if x > 0.0 else 1.0


@compile_kernel
def _choice_in_lanes(numbers: np.ndarray, result: np.ndarray) -> None:
    _choice(side_by_side(numbers)[0], side_by_side(result))


def test_what_lanes_cannot_do_is_one_line_with_its_place() -> None:
    with pytest.raises(Exception) as failure:
        _choice_in_lanes(np.zeros((1, LANES)), np.zeros((1, LANES)))
    line = describe_uncompilable(failure.value)
    assert line is not None
    number = _choice.__wrapped__.__code__.co_firstlineno + 2
    assert line.startswith(
        f"test_lanes.py, line {number}: the kernel computes several robots at once; choose by where("
    )
    assert describe_failure(failure.value) == (line, 1)
    assert describe_uncompilable(ValueError("File 'x', line 3: lanes")) is None
