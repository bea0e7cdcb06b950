"""Where gravity hardly changes, a zero and a droop are one number; a ladder of poses tells them apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from swinging_arm import PERIOD, arm
from test_next_experiment import played, swings

from gsl.core.dynamics import gravity_torque
from gsl.core.plant import nominal
from gsl.diagnosis.design.motions import ladder
from gsl.diagnosis.design.next_experiment import next_experiment
from gsl.diagnosis.simulate import calibration
from gsl.diagnosis.verdict.document import document
from gsl.diagnosis.verdict.findings import Findings
from gsl.diagnosis.verdict.zero_or_load import find_droops
from gsl.policies.limits import breach, limits
from gsl.worlds.held import Held

pytestmark = pytest.mark.slow

OFF = {"zero_offset": {"offset": 0.014, "joints": "shoulder"}}
LEFT_OUT = ("zero_offset", "sensor_bias", "gravity_tilt", "link_mass", "centre_of_mass", "external_push")


@pytest.fixture(scope="module")
def bent() -> Findings:
    """A log about one pose in which the arm's own weight pulls."""
    return played(OFF, swings(0.08, 0.9, 1.2), without=LEFT_OUT)


def test_gravitys_torque_is_what_makes_a_servo_droop() -> None:
    plant, pose = nominal(arm()), np.array([0.9, 0.6])
    position = Held.of(plant, 0.002, PERIOD).play([np.repeat(pose[None], 100, axis=0)], [pose], 1)[0][-1]
    torque = gravity_torque(plant.robot, dict(zip(plant.robot.motors, position.tolist(), strict=True)), plant.gravity)
    np.testing.assert_allclose(pose - position, torque / plant.servo.kp, rtol=1e-3)
    assert abs(torque[0]) > 0.1


def test_a_zero_in_a_log_of_one_pose_may_be_a_load(bent: Findings) -> None:
    (droop,) = find_droops(bent)
    assert droop.joint == "shoulder" and droop.separable
    assert abs(droop.zero) == pytest.approx(0.014, abs=0.006)
    assert 0.0 < droop.wrong <= 1.0
    caveats = " ".join(document(bent)["caveats"])
    assert "a shifted zero and another droop under gravity" in caveats and "shoulder" in caveats


def test_the_ladder_that_tells_them_apart_keeps_the_limits(bent: Findings) -> None:
    wanted = next_experiment(bent, [])
    assert wanted is not None and wanted.separates == (("zero_offset", "gravity_droop"),)
    assert [name for name, _ in wanted.episodes] == ["pose_ladder_a", "pose_ladder_b", "pose_ladder_a"]
    (unsure,) = find_droops(bent)
    for _, targets in ladder([(unsure.mover, unsure.ends)], arm(), PERIOD).variants:
        assert breach(limits(arm()), targets, PERIOD) is None
        assert targets[:, 0].min() == pytest.approx(unsure.ends[0]) and targets[:, 0].max() == pytest.approx(
            unsure.ends[1]
        )
        assert np.ptp(targets[:, 1]) == 0.0


def test_after_the_ladder_nothing_is_left_to_tell(bent: Findings) -> None:
    (unsure,) = find_droops(bent)
    climbed = played(OFF, dict(ladder([(unsure.mover, unsure.ends)], arm(), PERIOD).variants), without=LEFT_OUT)
    assert find_droops(climbed) == ()


def test_a_log_with_the_base_turned_round_tells(bent: Findings) -> None:
    """Half of the windows are said to hang the other way round; what gravity did there is then part of the answer."""
    pieces, turned = bent.log.pieces, {"gravity_tilt": {"pitch": 3.14}}
    turned_pieces = replace(pieces, conditions=tuple(({}, turned)[k % 2] for k in range(len(bent.log.records))))
    assert find_droops(replace(bent, log=replace(bent.log, pieces=turned_pieces))) == ()


def test_a_zero_that_is_named_is_one_as_well() -> None:
    """Where the library explains it, an offset in the servo or in the log is still no load for sure."""
    named = played(OFF, swings(0.08, 0.9, 1.2), without=LEFT_OUT[2:])
    off = replace(named.answer.fit, shifts=calibration.no_shifts(2))
    candidate = next(entry for entry in named.problem.library if entry.effect in ("zero_offset", "sensor_bias"))
    cause = named.problem.fit((candidate,), np.array([0.014]), calibration.no_shifts(2))
    chosen = replace(cause, fit=off)
    verdict = replace(named.verdict, word="inseparable")
    offset = replace(named, selection=replace(named.selection, chosen=chosen), verdict=verdict)
    assert [droop.joint for droop in find_droops(offset)] == ["shoulder"]


def test_a_log_of_many_poses_shows_a_zero_as_what_it_is() -> None:
    wide = played(OFF, swings(0.9, 0.0, 0.3), without=LEFT_OUT)
    zero = wide.answer.fit.shifts[[calibration.ZERO, calibration.OFFSET], 0].sum()
    assert abs(zero) == pytest.approx(0.014, abs=0.006)
    assert find_droops(wide) == ()
