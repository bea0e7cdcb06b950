"""What is left: a log leaves room for at least what there is, and parts that are as far off as before are told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from swinging_arm import FEW, arm, found, log

from gsl.core.plant import nominal
from gsl.diagnosis.diagnose import diagnose
from gsl.diagnosis.simulate.calibration import INERTIA, clip_shifts
from gsl.diagnosis.verdict.caveats import list_first, out_of_family
from gsl.diagnosis.verdict.limits import Limit, limits
from gsl.diagnosis.verdict.shrinkage import find_unexplained
from gsl.report.diagnosis_limits import limits_sentence

pytestmark = pytest.mark.slow

NEAR: dict[str, Any] = {"by_joint": [{"after": 1.0}], "by_regime": []}  # as `shrinkage` tells it
HIDDEN = {
    "command_latency": ("delay", 2e-4),
    "load_friction": ("coefficient", 5e-3),
}


def left_room(effects: Mapping[str, Any], **how: Any) -> dict[str, Limit]:
    result = diagnose(log(effects, **how), nominal(arm()), 0.002, FEW, lambda _: None)
    assert result.answer.names == ()
    return {limit.effect: limit for limit in limits(result, NEAR, lambda _: None)}


@pytest.mark.parametrize("effect", HIDDEN)
def test_what_hides_below_the_noise_is_within_the_limit(effect: str) -> None:
    name, value = HIDDEN[effect]
    limit = left_room({effect: {name: value}}, noise=5e-3)[effect]
    assert limit.parameter == name
    assert value <= limit.most < 0.25 * limit.documented


def test_limits_are_on_top_of_what_was_named() -> None:
    """Play of no width is not none, since its teeth give: .07 mrad of it would be ruled out for that alone."""
    others = tuple(sorted({*FEW.without} - {"backlash", "zero_offset", "stribeck_friction"}))
    hidden = limits(found({"coulomb_friction": {"torque": 0.15}}, without=others), NEAR, lambda _: None)
    assert next(limit.most for limit in hidden if limit.effect == "backlash") > 2e-4
    shares = [limit.most / limit.documented for limit in hidden]
    assert shares == sorted(shares) and shares[-1] <= 0.5
    assert {"backlash", "command_latency", "load_friction"} <= {limit.effect for limit in hidden}
    assert not {"coulomb_friction", "viscous_friction", "servo_gain", "zero_offset"} & {
        limit.effect for limit in hidden
    }


def test_where_a_gap_is_unexplained_nothing_is_ruled_out() -> None:
    lagging = ("command_latency", "target_smoothing", "viscous_friction", "servo_gain")
    result = found({"command_latency": {"delay": 0.03}}, without=(*FEW.without, *lagging))
    assert result.verdict.word == "unknown"
    assert limits(result, NEAR, lambda _: None) == []


def test_what_shakes_walks_or_is_explained_in_part_has_no_limits() -> None:
    result = found({}, without=FEW.without)
    assert limits(result, NEAR, lambda _: None)
    shaking = replace(result.log.comparison, shaking=np.array([True, False]))
    part = replace(result.verdict, word="causes", explained=0.88, remaining=1.5)
    for other in (
        replace(result, verdict=part),
        replace(result, log=replace(result.log, comparison=shaking)),
    ):
        assert limits(other, NEAR, lambda _: None) == []
    turning = {"by_joint": [], "by_regime": [{"regime": "reversal", "before": 10.4, "after": 7.1}]}
    assert limits(result, turning, lambda _: None) == []


def test_a_sentence_tells_the_tightest() -> None:
    rows = [{"effect": f"effect_{k}", "parameter": "width", "unit": "rad", "most": 0.001 * k} for k in range(1, 7)]
    assert limits_sentence({"limits": rows}) == (
        "All joints alike have at most: effect 1 0.06°, effect 2 0.11°, effect 3 0.17°, effect 4 0.23° "
        "and 2 more, in the report."
    )
    assert str(limits_sentence({"limits": rows, "causes": [{}]})).startswith("If these causes are right, all joints")
    assert limits_sentence({"limits": []}) is None


def test_a_sentence_names_the_first_joints_and_how_many_more_there_are() -> None:
    assert list_first(["a", "b", "c"]) == "a, b, c"
    assert list_first(["a", "b", "c", "d"]) == "a, b, c, and 1 joint more: see the calibration"
    assert list_first(["a", "b", "c", "d", "e"]) == "a, b, c, and 2 joints more: see the calibration"


def test_a_rotor_that_is_as_light_as_it_can_be_is_out_of_family() -> None:
    result = found({}, without=FEW.without)
    fit = result.answer.fit
    light = clip_shifts(np.where(np.arange(7)[:, None] == INERTIA, -99.0, 0.0) * np.array([1.0, 0.0]))
    answer = replace(result.selection.none, fit=replace(fit, shifts=light))
    selection = replace(result.selection, none=answer, chosen=answer)
    assert out_of_family(replace(result, selection=selection)) == ["shoulder (inertia -2.5 g·m², at its limit)"]
    assert out_of_family(result) == []


def test_a_part_of_the_log_that_is_as_far_off_as_before_is_not_explained() -> None:
    regimes = [{"regime": "all", "before": 4.0, "after": 4.0}, {"regime": "high_load", "before": 11.0, "after": 12.0}]
    joints = [{"joint": "Jaw", "before": 2.5, "after": 2.4}, {"joint": "Elbow", "before": 5.0, "after": 3.0},
              {"joint": "Wrist", "before": 1.5, "after": 1.6}]  # fmt: skip
    assert find_unexplained({"by_regime": regimes, "by_joint": joints}) == [
        {"part": "asked for much torque", "before": 11.0, "after": 12.0},
        {"part": "Jaw", "before": 2.5, "after": 2.4},
    ]
