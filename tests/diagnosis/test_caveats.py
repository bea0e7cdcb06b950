"""What a diagnosis tells to be careful with."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from swinging_arm import FEW, found
from test_verdict import EMPTY, friction, selection, with_both

from gsl.diagnosis.verdict.caveats import caveats
from gsl.diagnosis.verdict.findings import Findings
from gsl.diagnosis.verdict.servo_law import Laws
from gsl.diagnosis.verdict.verdict import Verdict

pytestmark = pytest.mark.slow

LEFT: dict[str, Any] = {"fraction": 0.63, "nearest_fraction": 0.63, "nearest_left": 0.01}
NAMED = Verdict("causes", (), (), 0.97, 1.0, 1.0)


def nothing_found() -> Findings:
    return found({}, without=FEW.without)


def named(result: Findings, **changes: Any) -> Findings:
    return replace(result, verdict=NAMED, **changes)


def test_what_remains_is_told_of_held_out_squares() -> None:
    lines = caveats(named(nothing_found()), (), LEFT, [{"part": "fast", "before": 5.1, "after": 5.3}])
    assert "37 % of the held-out excess remains: something else is at work as well." in lines
    assert lines[1].endswith("fast (5.1 → 5.3 ×). What is not named is not excluded there.")
    assert not any("remains" in line for line in caveats(named(nothing_found()), (), {"fraction": 0.98}, []))


def test_a_value_that_hangs_on_another_effect_is_told() -> None:
    alone = friction("all", 300.0)
    other = replace(EMPTY.candidates[0].on("elbow"), effect="backlash")
    both = with_both(alone, replace(alone, candidates=(other,)), 290.0)
    both = replace(both, parameters=(np.array([0.04]), np.array([0.02])), costs=np.array([260.0, 320.0] * 4))
    result = nothing_found()
    chosen = cast(Any, selection(alone, both))
    (caveat,) = [
        line for line in caveats(named(result, selection=chosen), (), {"fraction": 1.0}, []) if "besides" in line
    ]
    assert caveat.startswith("With backlash besides, which costs less and was passed over (not significantly better): ")
    assert "coulomb friction's torque 0.04 instead of 0.1." in caveat
    same = replace(both, parameters=(alone.parameters[0] * 1.0001, np.array([0.02])))
    lines = caveats(named(result, selection=cast(Any, selection(alone, same))), (), {"fraction": 1.0}, [])
    assert not any("besides" in line for line in lines)  # "0.1 instead of 0.1" tells nothing


def test_a_value_beyond_its_documented_range_is_told() -> None:
    alone = friction("all", 300.0)
    beyond = replace(alone, parameters=(np.array([99.0]),))
    lines = caveats(named(nothing_found(), selection=cast(Any, selection(beyond))), (), {"fraction": 1.0}, [])
    assert any(line.startswith("coulomb friction's torque of 99 is beyond what is documented") for line in lines)


def test_far_above_the_noise_a_tolerance_of_what_a_law_of_each_servo_leaves_is_proposed() -> None:
    result, far = nothing_found(), Verdict("unknown", (), (), 0.2, 400.0, 0.1)
    z = np.full((len(result.log.held_out), result.log.pieces.scored, 2), 0.006) / result.log.comparison.floor
    laws = replace(cast(Laws, result.laws), z=z)
    caveat = next(
        line for line in caveats(replace(result, verdict=far, laws=laws), (), LEFT, []) if "far above" in line
    )
    assert "tolerance=0.006 [rad]" in caveat and "twice" not in caveat
    alone = replace(result.log, noise=replace(result.log.noise, source="estimated"))
    caveat = next(
        line
        for line in caveats(replace(result, log=alone, verdict=far, laws=None), (), LEFT, [])
        if "far above" in line
    )
    assert "record a motion twice" in caveat and "tolerance=0.02 [rad]" in caveat


def test_where_little_is_left_it_is_asked_whether_that_matters() -> None:
    unsure = replace(nothing_found(), verdict=Verdict("unknown", (), (), 0.98, 1.3, 0.1))
    left = LEFT | {"nearest_fraction": 0.9996, "nearest_left": 0.00086}
    (caveat,) = [line for line in caveats(unsure, (), left, []) if "beyond the noise" in line]
    assert caveat.startswith("With a calibration 99.9 % of the gap is gone.")
    assert "0.86 mrad" in caveat and caveat.endswith("diagnose again with tolerance=0.002 [rad].")
    far = [line for share in (0.8, None) for line in caveats(unsure, (), left | {"nearest_fraction": share}, [])]
    hollow = caveats(replace(unsure, verdict=replace(unsure.verdict, hollow=True)), (), left, [])
    assert not any("beyond the noise" in line for line in [*far, *hollow])
