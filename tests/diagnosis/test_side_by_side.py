"""Fits and screenings side by side: threads change no bit, and no fit is done twice."""

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
NAMES = ("armature", "backlash", "viscous_friction")


def problem(threads: int, ticks: list[str]) -> Problem:
    exp = cut_log(log({"armature": {"inertia": 0.002}}), arm())
    simulator = simulator_of(exp, nominal(arm()), 0.002, threads=threads)
    return Problem.of(exp, simulator, Options(), ticks.append).only(NAMES)


def test_threads_change_no_bit_of_fits_and_screenings() -> None:
    came = []
    for threads in (1, 2):
        asked = problem(threads, ticks := [])
        none = asked.fit_calibration()
        still = no_shifts(asked.train.joints)
        asks = [Ask((part,), part.grid[0], still) for part in asked.library]
        fits = asked.fit_all(asks)
        leads = screen(asked, none).leads
        values = [fit.start for fit in fits] + [lead.parameters for lead in leads]
        came.append(([fit.cost for fit in fits], np.concatenate(values).tobytes(), [lead.cost for lead in leads]))
        assert len(ticks) >= len(asks) + len(asked.library)
    assert came[0] == came[1]


def test_a_fit_that_was_asked_for_is_remembered() -> None:
    asked = problem(2, ticks := [])
    part, still = asked.library[0], no_shifts(asked.train.joints)
    ask = Ask((part,), part.grid[0], still)
    first, again = asked.fit_all([ask, ask])
    assert first is again and asked.fit((part,), part.grid[0], still) is first
    assert ticks == ["", "", ""]
