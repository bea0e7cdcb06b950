"""Lanes against numpy, lane by lane; sine and cosine against the C library's."""

import numpy as np

from gsl.core.compiled import compile_kernel
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
    result[5], result[6] = np.sqrt(abs(x)), np.log(1.0 + abs(x))


@compile_kernel
def _functions_in_lanes(numbers: np.ndarray, result: np.ndarray) -> None:
    _functions(side_by_side(numbers)[0], side_by_side(result))


def test_a_law_may_use_the_functions_of_numpy() -> None:
    numbers, result = np.random.default_rng(1).standard_normal((1, LANES)), np.zeros((7, LANES))
    _functions_in_lanes(numbers, result)
    for lane in range(LANES):
        single = np.zeros(7)
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
