"""Repeats are found by what was commanded as a function of time, whatever clock the logger had."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from swinging_arm import NOISE, PERIOD, arm, log

from gsl.diagnosis.log.floor import noise_floor
from gsl.diagnosis.log.log import cut_log
from gsl.diagnosis.log.records import Record, slope
from gsl.diagnosis.log.repeats import Repeat, find_repeats

LAG = 0.06  # by which joints are behind what is commanded [s]
Path = Callable[[np.ndarray], np.ndarray]


def sines(time: np.ndarray) -> np.ndarray:
    """Two joints that swing from 0.5 s on."""
    on = np.clip(time - 0.5, 0.0, None)
    return np.stack([0.4 * np.sin(3.0 * on), 0.3 * np.sin(5.0 * on)], axis=-1)


def steps(time: np.ndarray) -> np.ndarray:
    """Two joints that jump every second."""
    k = np.floor(time - 0.5).astype(int)
    return np.stack([0.2 * (k % 3), 0.1 * (k % 2)], axis=-1) * (time >= 0.5)[:, None]


def record(path: Path, *, begun: float = 0.0, stale: float = 0.0, seed: int = 0, rows: int = 400) -> Record:
    """What a logger writes that began a motion's recording at a time, with commands up to `stale` seconds old."""
    rng = np.random.default_rng(seed)
    time = begun + PERIOD * np.arange(rows + 1)
    targets = path(time[:-1] - stale * rng.uniform(size=rows))
    position = path(time - LAG) + NOISE * rng.standard_normal((rows + 1, 2))
    return Record("", targets, position, slope(position, PERIOD))


@pytest.mark.parametrize("path", [sines, steps])
@pytest.mark.parametrize("begun", [0.0, 0.2, 0.313, -0.428])
def test_the_same_motion_is_a_repeat_whenever_its_logger_began(path: Path, begun: float) -> None:
    repeats = find_repeats([record(path), record(path, begun=begun, stale=PERIOD, seed=1)], PERIOD)
    assert [repeat.motion for repeat in repeats] == [0, 0]
    assert repeats[1].later == pytest.approx(-begun / PERIOD, abs=1.0)


@pytest.mark.parametrize("begun", [0.2, 0.313])
def test_the_floor_of_such_repeats_is_that_of_the_noise(begun: float) -> None:
    records = [record(sines), record(sines, begun=begun, seed=1)]
    floor = noise_floor(records, find_repeats(records, PERIOD), PERIOD, 1e-4)
    assert floor.source == "repeats" and floor.sd == pytest.approx(NOISE, rel=0.25)


COARSE = 0.0175  # a degree [rad]


@pytest.mark.parametrize("dither", [0.3, 0.0, None])
def test_a_coarse_encoder_is_noise_and_a_repeat_that_wanders_is_not(dither: float | None) -> None:
    """Both differ far more from one repeat to the next than the others."""

    def four(time: np.ndarray) -> np.ndarray:
        return np.hstack([sines(time), sines(time)])

    def logged(seed: int) -> Record:
        time = PERIOD * np.arange(401)
        position = four(time - LAG) + NOISE * np.random.default_rng(seed).standard_normal((401, 4))
        wander = 0.03 * np.sin(0.9 * time + 2.0 * seed)
        noisy = position[:, 3] + (dither or 0.0) * COARSE * np.random.default_rng(seed + 9).standard_normal(401)
        position[:, 3] = position[:, 3] + wander if dither is None else COARSE * np.rint(noisy / COARSE)
        return Record("", four(time[:-1]), position, slope(position, PERIOD))

    records = [logged(0), logged(1)]
    floor = noise_floor(records, find_repeats(records, PERIOD), PERIOD, 1e-4)
    assert floor.unsteady.tolist() == [False, False, False, dither is None]
    assert floor.sd[:3] == pytest.approx(NOISE, rel=0.25)
    assert (floor.sd[3] > 0.004) == (dither is not None)


def test_a_late_row_of_a_fast_logger_is_jitter() -> None:
    fast, rng = 0.001, np.random.default_rng(3)
    time = fast * np.arange(3000)
    first, again = (sines(when) for when in (time, time - 0.004 * rng.uniform(size=len(time))))
    position = np.zeros((3001, 2))
    records = [Record("", targets, position, position) for targets in (first, again)]
    assert [repeat.motion for repeat in find_repeats(records, fast)] == [0, 0]


def test_another_motion_is_none() -> None:
    def larger(time: np.ndarray) -> np.ndarray:
        return 1.05 * sines(time)

    def other_way(time: np.ndarray) -> np.ndarray:
        return -sines(time)

    def faster(time: np.ndarray) -> np.ndarray:
        return sines(1.1 * time)

    def exchanged(time: np.ndarray) -> np.ndarray:
        return sines(time)[:, ::-1]

    paths: list[Path] = [sines, larger, other_way, faster, exchanged, steps]
    repeats = find_repeats([record(path, seed=k) for k, path in enumerate(paths)], PERIOD)
    assert [repeat.motion for repeat in repeats] == [0, 1, 2, 3, 4, 5]


def test_joints_that_go_against_each_other_wherever_they_are_aligned_are_no_repeat() -> None:
    """As poses are that share no more than their range."""
    up = record(lambda time: np.stack([0.3 * (time > 4.0), 0.3 * (time > 4.0)], axis=-1))
    down = record(lambda time: 0.3 - np.stack([0.3 * (time > 4.0), 0.3 * (time > 4.0)], axis=-1), seed=1)
    assert [repeat.motion for repeat in find_repeats([up, down], PERIOD)] == [0, 1]


def test_a_part_of_a_motion_is_no_repeat_of_it() -> None:
    assert [r.motion for r in find_repeats([record(sines), record(sines, rows=250)], PERIOD)] == [0, 1]


def test_equal_rows_are_repeats_with_nothing_between_them() -> None:
    first = record(steps)
    again = replace(first, position=first.position + 0.01)
    assert find_repeats([first, again], PERIOD) == [Repeat(0), Repeat(0)]


def test_repeats_of_another_clock_stay_on_one_side_of_the_split_and_count_as_one_motion() -> None:
    batch = log({})
    moved = [replace(episode, action=episode.action + 1e-5) for episode in batch.episodes]
    batch = replace(batch, episodes=(*batch.episodes[:-1], moved[-1]))  # the last motion repeats the first
    cut = cut_log(batch, arm())
    first, again = cut.order.index(0), cut.order.index(8)
    sides = [set(cut.pieces.record[part].tolist()) & {first, again} for part in (cut.train, cut.held_out)]
    assert cut.motions == 8 and cut.noise.source == "repeats"
    assert {first, again} in sides and set() in sides


def hold(time: np.ndarray) -> np.ndarray:
    """Two joints that are held, one of them by a controller that trembles a little."""
    return 0.3 + 4e-4 * np.stack([np.zeros_like(time), np.sin(40.0 * time)], axis=-1)


@pytest.mark.parametrize("rows", [40, 400])
def test_held_joints_say_nothing_of_when_a_motion_began(rows: int) -> None:
    again = record(lambda time: hold(time) + 1e-5, begun=0.013, seed=1, rows=rows)
    assert find_repeats([record(hold, rows=rows), again], PERIOD) == [Repeat(0), Repeat(0)]


@pytest.mark.parametrize("rows", [1, 2, 9])
def test_records_of_few_rows_are_no_repeats(rows: int) -> None:
    def short(seed: int) -> Record:
        whole = record(sines, begun=1e-3 * seed, seed=seed)
        return replace(whole, targets=whole.targets[50 : 50 + rows], position=whole.position[50 : 51 + rows])

    assert [repeat.motion for repeat in find_repeats([short(0), short(1)], PERIOD)] == [0, 1]
