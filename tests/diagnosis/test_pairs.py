"""Two effects that make joints shake are found together: alone, each is far from its value beside the other."""

import pytest
from swinging_arm import arm, log

from gsl.core.plant import nominal
from gsl.diagnosis.hypothesis.problem import Problem
from gsl.diagnosis.log.log import cut_log
from gsl.diagnosis.options import Options
from gsl.diagnosis.search.screening import extend
from gsl.diagnosis.search.selection import Thresholds
from gsl.diagnosis.search.stepwise import Search
from gsl.diagnosis.simulate.simulator import simulator_of

pytestmark = pytest.mark.slow


def test_a_late_measurement_and_a_weak_damping_are_both_named() -> None:
    part = cut_log(log({"sensor_delay": {"delay": 0.012}, "servo_gain": {"kd": 0.5}}), arm())
    assert part.comparison.shaking.all()
    simulator = simulator_of(part, nominal(arm()), 0.002, threads=2)
    problem = Problem.of(part, simulator, Options(), lambda _: None).only(("sensor_delay", "servo_gain"))
    none = problem.fit_calibration()
    alone = extend(problem, none, 1)[0][0]
    assert alone.places == {("sensor_delay", "all")} and alone.start[0] > 0.018
    chosen = Search(problem, none, Thresholds(share=0.1), most=2).select().chosen
    assert chosen.cost < 0.5 * alone.cost
    assert chosen.places == {("sensor_delay", "all"), ("servo_gain", "all")}
    values = {candidate.effect: candidate.entry(values) for candidate, values in chosen.pairs}
    assert values["sensor_delay"]["delay"] == pytest.approx(0.012, rel=0.2)
    assert values["servo_gain"]["kd"] == pytest.approx(0.5, rel=0.3)
