"""The benchmark's own arithmetic; its figures are for people, not for tests."""

import time

from gsl_benchmarks.bench import FIGURES, judge
from gsl_benchmarks.loop import StepClock


def test_a_clock_counts_what_happens_inside_and_nothing_else() -> None:
    def work(milliseconds: int) -> None:
        end = time.thread_time() + 1e-3 * milliseconds
        while time.thread_time() < end:
            pass

    clock = StepClock(work)
    for _ in range(5):
        clock(2)
        work(4)
    assert clock.calls == 5
    assert 0.010 <= clock.seconds < 0.013


def test_a_figure_above_its_target_is_said_to_be_over() -> None:
    assert judge("loop_ratio", 1.21)[2:] == ("1.21", "1.3", "ok")
    assert judge("reload_share", 0.0123)[2:] == ("0.0123", "0.01", "over")
    assert judge("step_us", 29.6)[2:] == ("30", "", "")


def test_the_figures_are_those_that_were_agreed() -> None:
    loops = {"loop_ratio", "loop_ratio_grounded", "loop_ratio_servo"}
    search = {"rollouts_per_hour", "paper_hours"}
    assert FIGURES.keys() == loops | search | {"worker_inflation", "reload_share", "io_share", "help_cpu_ms", "step_us"}
