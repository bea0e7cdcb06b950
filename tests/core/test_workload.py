"""How far work is: the share that is done never falls, and the time left comes from what was worked."""

from __future__ import annotations

import itertools
import os
from pathlib import Path

import pytest

from gsl.core.compiling import count_compilation, is_compiling, share_compilations
from gsl.core.workload import Part, Workload


class Clock:
    """A clock that stands still between its ticks."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def work() -> tuple[Workload, Clock, list[float]]:
    clock, shares = Clock(), list[float]()
    load = Workload(lambda: shares.append(load.share), clock)
    return load, clock, shares


def test_a_share_is_of_all_parts_by_their_time_and_never_falls() -> None:
    load, _, shares = work()
    with load.plan("stage", [Part(10.0, 4), Part(30.0, 2)]):
        for loops in ((3, 3), (1, 1)):  # the first part has more steps than were foreseen
            for steps in loops:
                with load.loop(steps, "walking") as loop:
                    for _ in range(steps):
                        loop.advance()
            load.finish()
    assert shares[:4] == pytest.approx([0.0625, 0.125, 0.1875, 0.25])
    assert shares[-1] == 1.0 and all(after >= before for before, after in itertools.pairwise(shares))
    assert shares[-3:] == pytest.approx([0.625, 1.0, 1.0])


def test_a_plan_within_a_part_is_that_part() -> None:
    load, _, shares = work()
    with load.plan("result", [Part(), Part()]):
        with load.plan("stage", [Part(1.0), Part(3.0)]):
            load.begin("collect")
            assert "result 1 of 2, stage 1 of 2 (collect)" in load.text()
            load.finish()
            load.finish()
        load.finish()
        with load.plan("stage", []):  # nobody knows how many
            load.finish()
            assert "result 2 of 2, stage 2" in load.text()
        load.finish()
    assert [*dict.fromkeys(shares)] == pytest.approx([0.0, 0.125, 0.5, 1.0])


def test_work_is_planned_where_somebody_around_knows_how_long_it_takes() -> None:
    load, _, _ = work()
    assert not load.has_plan
    with load.plan("result", [Part()]):
        assert not load.has_plan
        with load.plan("stage", [Part(1.0), Part()]):
            assert load.has_plan
            with load.plan("part", [Part()]):
                assert load.has_plan
        assert not load.has_plan


def test_the_time_left_is_that_of_the_plan_until_the_clock_knows_better() -> None:
    load, clock, _ = work()
    with load.plan("stage", [Part(100.0, 100)]), load.loop(100, "walking") as loop:
        assert load.left() == pytest.approx(100.0)
        for _ in range(50):
            clock.now += 3.0  # three times as slow as foreseen
            loop.advance()
        assert load.left() == pytest.approx(150.0, rel=0.1)
        clock.now += 20.0  # while a step goes on
        assert load.left() == pytest.approx(130.0, rel=0.1)
        clock.now += 200.0
        assert load.left() == 0.0 and "left" not in load.text()


def test_a_part_that_takes_longer_than_planned_takes_nothing_from_those_after_it() -> None:
    load, clock, _ = work()
    with load.plan("stage", [Part(10.0), Part(20.0), Part(30.0)]):
        load.finish()
        clock.now = 15.0
        assert load.left() == pytest.approx(35.0)
        clock.now = 90.0
        assert load.left() == pytest.approx(30.0)


def test_what_was_done_before_is_no_pace() -> None:
    load, clock, _ = work()
    with load.loop(100, "walking") as loop:
        assert load.left() is None
        loop.advance(79, worked=False)
        assert load.left() is None
        loop.advance()
        clock.now += 10.0
        loop.advance(10)
        assert load.left() == pytest.approx(10.0)
        assert load.text() == "90 % done, about 10 s left; walking: 90 of 100, 1.0 a second"
        clock.now += 10.0
        assert "2.0 s each" in load.text()


@pytest.mark.parametrize("seconds", [0.0, 20.0])
def test_the_first_step_which_compiles_is_no_pace(seconds: float) -> None:
    load, clock, _ = work()
    with load.plan("stage", [Part(seconds, 21)]), load.loop(21, "walking") as loop:
        clock.now += 120.0
        loop.advance()
        assert "each" not in load.text() and (load.left() is None or seconds)
        for _ in range(10):
            clock.now += 1.0
            loop.advance()
        assert load.left() == pytest.approx(10.0, rel=0.1)
        assert load.text() == "52 % done, about 10 s left; stage 1 of 1, walking: 11 of 21, 1.0 a second"


def test_compilation_is_said_in_place_of_the_time_left_and_is_no_pace() -> None:
    load, clock, _ = work()
    with load.plan("stage", [Part(20.0, 2), Part(20.0, 20)]), load.loop(2, "collecting") as loop:
        loop.advance()
        count_compilation(1)
        for _ in range(60):
            assert "about" not in load.text() and "collecting: 1 of 2, compiling, once" in load.text()
            clock.now += 2.0
        count_compilation(-1)
        assert "about 30 s left" in load.text()
        clock.now += 10.0
        loop.advance()
        assert load.text() == "50 % done, about 20 s left; stage 1 of 2, collecting: 2 of 2, 10.0 s each"


def test_a_temporary_folder_that_was_tidied_up_ends_no_display() -> None:
    folder = Path(share_compilations())
    folder.rmdir()
    assert not is_compiling()
    folder.mkdir()
    stranger = folder / "1"  # of another user, where this is not run by root
    stranger.touch()
    assert is_compiling() == (os.geteuid() == 0)
    stranger.unlink()


def test_a_phase_has_its_own_clock_until_a_loop_or_a_part_says_more() -> None:
    load, clock, _ = work()
    with load.at_work("diagnose"):
        clock.now += 2.0
        assert load.text() == "diagnose, 2 s"
        load.enter("looking at the wiring")
        clock.now += 3.0
        assert load.text() == "looking at the wiring, 3 s"
        count_compilation(1)
        assert load.text() == "looking at the wiring, 3 s, compiling, once after an installation"
        count_compilation(-1)
        with load.plan("fold", [Part(), Part()]):
            load.begin("gain 8")
            assert load.text() == "0 % done; fold 1 of 2 (gain 8)"
            load.enter("searching")
            assert load.text() == "0 % done; fold 1 of 2 (gain 8), searching, 0 s"
            with load.loop(2, "replaying"):
                assert load.text() == "0 % done; fold 1 of 2 (gain 8), replaying: 0 of 2"
            load.finish()
        load.enter("loading joints")
        with load.loop(2, "optimising"):
            clock.now += 1.0
        assert load.text() == "diagnose, 6 s", "what was done before the loop is over"
    assert load.text() == ""


def test_each_work_begins_anew() -> None:
    load, clock, _ = work()
    for _ in range(2):
        with load.loop(2, "walking") as loop:
            loop.best("best 1.0 m")
            loop.fell(1)
            clock.now += 1.0
            loop.advance()
            assert load.text() == "50 % done; walking: 1 of 2; best 1.0 m, 1 fall"
    assert load.text() == ""
