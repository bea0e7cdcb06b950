"""The benchmark's own arithmetic; its figures are for people, not for tests."""

import time

import pytest

from gsl.core.console import Silent
from gsl.core.interfaces import SIM
from gsl.grounding.none import NoGrounding
from gsl.policies.walk_engine import WalkEngine
from gsl.rollout.rollout import Scenario
from gsl.tasks.walk import Walk
from gsl.worlds.bullet import BulletWorld
from gsl_benchmarks.bench import FIGURES, judge, measure_workers
from gsl_benchmarks.loop import StepClock

pytestmark = pytest.mark.slow


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


def test_cpu_of_workers_is_counted_where_the_rollouts_are() -> None:
    walk = Walk(duration=0.2)
    scenario = Scenario(BulletWorld(robot="nao", effects={}), walk, WalkEngine(), SIM, NoGrounding())
    inflation, seconds, made = measure_workers(scenario, Silent(), rollouts=6)
    assert len(made) == 6
    assert 0.2 < inflation < 20.0  # a worker that is counted from its start would have spent seconds on imports
    assert seconds > 0.0


def test_a_figure_above_its_target_is_said_to_be_over() -> None:
    assert judge("loop_ratio", 1.21)[2:] == ("1.21", "1.2", "over")
    assert judge("reload_share", 0.0123)[2:] == ("0.0123", "0.01", "over")
    assert judge("step_us", 29.6)[2:] == ("30", "", "")


def test_the_figures_are_those_that_were_agreed() -> None:
    loops = {"loop_ratio", "loop_ratio_grounded", "loop_ratio_servo"}
    search = {"rollouts_per_hour", "paper_hours"}
    assert FIGURES.keys() == loops | search | {"worker_inflation", "reload_share", "io_share", "help_cpu_ms", "step_us"}
