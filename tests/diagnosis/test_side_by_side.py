"""Fits and screenings side by side: threads change no bit, and no fit is done twice."""

from threading import Barrier
from time import sleep
from typing import Any

import numpy as np
import pytest
from swinging_arm import arm, log

from gsl.core.plant import nominal
from gsl.diagnosis.hypothesis.problem import Ask, Problem
from gsl.diagnosis.log.log import cut_log
from gsl.diagnosis.options import Options
from gsl.diagnosis.search.screening import screen
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.simulator import simulator_of

pytestmark = pytest.mark.slow
NAMES = ("armature", "link_mass", "payload", "viscous_friction")


def problem(threads: int, ticks: list[str]) -> Problem:
    exp = cut_log(log({"armature": {"inertia": 0.002}}), arm())
    simulator = simulator_of(exp, nominal(arm()), 0.002, threads=threads)
    return Problem.of(exp, simulator, Options(), ticks.append).only(NAMES)


def test_threads_change_no_bit_of_fits_and_screenings() -> None:
    came = []
    for threads in (1, 2, 8):
        asked = problem(threads, ticks := [])
        none, still = asked.fit_calibration(), no_shifts(asked.train.joints)
        fits = asked.fit_all(
            [Ask((part,), np.atleast_1d(part.towards(part.bounds[1], 0.3)), still) for part in asked.library]
        )
        assert len(ticks) == 1 + len(fits)
        leads = screen(asked, none).leads
        values = [fit.start for fit in fits] + [lead.parameters for lead in leads]
        costs = [fit.cost for fit in fits] + [lead.cost for lead in leads]
        came.append((len(ticks), costs, np.concatenate(values).tobytes()))
    assert came[0] == came[1] == came[2]


def test_a_fit_that_was_asked_for_is_remembered() -> None:
    asked = problem(2, ticks := [])
    part, still = asked.library[0], no_shifts(asked.train.joints)
    ask = Ask((part,), part.neutral, still)
    first, again = asked.fit_all([ask, ask])
    assert first is again and asked.fit(*ask[:3]) is first
    assert ticks == [""]


def test_as_many_items_are_at_work_as_there_are_threads() -> None:
    simulator = problem(2, []).simulator
    meeting, threads = Barrier(2), list[int]()

    def meet(own: Any, item: int) -> int:
        threads.append(own.threads)
        return meeting.wait(30.0) * 0 + item

    assert simulator.side_by_side(meet, [4, 2], lambda _: None) == [4, 2] and threads == [1, 1]
    assert simulator.side_by_side(lambda own, _: own.threads, ["alone"], lambda _: None) == [2]


def test_what_a_result_raises_ends_the_work() -> None:
    begun = list[int]()

    def stop(item: int) -> None:
        raise KeyboardInterrupt(item)

    with pytest.raises(KeyboardInterrupt, match="0"):
        problem(2, []).simulator.side_by_side(
            lambda _, item: begun.append(item) or sleep(0.05) or item, range(50), stop
        )
    assert len(begun) < 10
