"""The corrected simulator in a file is the one whose replays were scored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_limits import found

from gsl.diagnosis import nuisance
from gsl.diagnosis.world_file import diagnosed_effects
from gsl.effects.effect import applied, built

PARTS = ("kp", "kd", "coulomb", "viscous", "armature", "offset", "load_friction", "stribeck")


@pytest.mark.parametrize("size", [-3.0, 2.0])
def test_a_calibration_of_either_sign_is_in_the_file(size: float) -> None:
    result = found({"coulomb_friction": {"torque": 0.15}})
    fit = result.answer.fit
    shifted = nuisance.bounded(size * nuisance.SIZES[:, None] * np.ones_like(fit.nuisances))
    answer = replace(result.answer, fit=replace(fit, nuisances=shifted))
    changed = replace(result, selection=replace(result.selection, chosen=answer, none=answer))
    assert changed.answer is answer and "coulomb_friction" in answer.names
    written = applied(result.simulator.plant, built(diagnosed_effects(changed)))
    for part in PARTS:
        scored = getattr(changed.corrected.servo, part)
        np.testing.assert_allclose(getattr(written.servo, part), scored, rtol=1e-4, atol=2e-6, err_msg=part)
