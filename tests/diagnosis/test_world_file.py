"""The corrected simulator in a file is the one whose replays were scored."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from swinging_arm import FEW, found
from test_plausibility import claim

from gsl.diagnosis.hypothesis.hypothesis import Hypothesis
from gsl.diagnosis.simulate import calibration
from gsl.effects.effect import apply_all, build

pytestmark = pytest.mark.slow

PARTS = ("kp", "kd", "coulomb", "viscous", "armature", "offset", "load_friction", "stribeck")


@pytest.mark.parametrize("size", [-3.0, 2.0])
@pytest.mark.parametrize(
    "cause",
    [claim("coulomb_friction", [0.15], ("torque",)), claim("servo_gain", [0.6, 0.2], ("kp", "kd"))],
    ids=["friction", "gains"],
)
def test_a_calibration_of_either_sign_is_in_the_file(cause: Hypothesis, size: float) -> None:
    result = found({}, without=FEW.without)
    fit = result.answer.fit
    shifted = calibration.clip_shifts(size * calibration.SPREADS[:, None] * np.ones_like(fit.shifts))
    parts = {"candidates": cause.candidates, "parameters": cause.parameters}
    answer = replace(result.answer, fit=replace(fit, shifts=shifted), **cast(Any, parts))
    changed = replace(result, selection=replace(result.selection, chosen=answer, none=answer))
    assert changed.answer is answer
    written = apply_all(result.simulator.plant, build(changed.effects))
    for part in PARTS:
        scored = getattr(changed.corrected.servo, part)
        np.testing.assert_allclose(getattr(written.servo, part), scored, rtol=1e-4, atol=2e-6, err_msg=part)
