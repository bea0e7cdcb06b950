"""Normal equations: joint by joint they have the solution of the whole matrix."""

import numpy as np
import pytest

from gsl.diagnosis.hypothesis.normal import Normal
from gsl.diagnosis.log.residual import weight
from gsl.diagnosis.simulate.calibration import SPREADS

SHIFTS, WINDOWS, SCORED, JOINTS = 7, 4, 9, 3


@pytest.mark.parametrize("parameters", [0, 1, 3])
@pytest.mark.parametrize("damping", [0.0, 30.0])
def test_a_step_is_that_of_the_whole_matrix(parameters: int, damping: float) -> None:
    rng = np.random.default_rng(parameters)
    z = 5.0 * rng.normal(size=(WINDOWS, SCORED, JOINTS))
    own = rng.normal(size=(parameters, *z.shape))
    slopes = rng.normal(size=(SHIFTS, *z.shape)) / SPREADS[:, None, None, None]
    at = rng.normal(size=(SHIFTS, JOINTS)) * SPREADS[:, None]
    normal = Normal.of(z, own, slopes, at, spread=0.5)
    step, shift = normal.solve(damping)

    each = np.zeros((SHIFTS, JOINTS, *z.shape))  # the derivative to a joint's shift is 0 in the other joints
    for joint in range(JOINTS):
        each[:, joint, ..., joint] = slopes[..., joint]
    columns = np.concatenate([own.reshape(parameters, z.size), each.reshape(SHIFTS * JOINTS, z.size)])
    prior = np.r_[np.zeros(parameters), np.repeat(1.0 / (0.5 * SPREADS) ** 2, JOINTS)]
    weighted = columns * weight(z).ravel()
    matrix = weighted @ columns.T + np.diag(prior)
    right = -weighted @ z.ravel() - prior * np.r_[np.zeros(parameters), at.ravel()]
    whole = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), right)
    assert step == pytest.approx(whole[:parameters], rel=1e-6)
    assert shift.ravel() == pytest.approx(whole[parameters:], rel=1e-6)
    assert normal.covariance == pytest.approx(np.linalg.inv(matrix)[:parameters, :parameters], rel=1e-6)


def test_a_parameter_that_changes_nothing_stays() -> None:
    z, slopes = np.ones((1, 2, 1)), np.ones((SHIFTS, 1, 2, 1))
    normal = Normal.of(z, np.zeros((1, *z.shape)), slopes, np.zeros((SHIFTS, 1)), spread=1.0)
    assert normal.solve()[0] == pytest.approx([0.0])


def test_two_equal_effects_share_a_step_that_the_ridge_keeps_small() -> None:
    rng = np.random.default_rng(0)
    slopes = rng.normal(size=(SHIFTS, WINDOWS, SCORED, JOINTS)) / SPREADS[:, None, None, None]
    alone = rng.normal(size=(1, WINDOWS, SCORED, JOINTS))
    still = np.zeros((SHIFTS, JOINTS))
    single, both = (Normal.of(-alone[0], own, slopes, still, 1.0) for own in (alone, np.concatenate([alone, alone])))
    assert single.solve()[0] == pytest.approx([1.0], rel=1e-3)
    assert both.solve()[0] == pytest.approx([0.5, 0.5], rel=1e-3)
    unsure = np.sqrt(np.diag(both.covariance))
    assert (unsure > 1e3 * np.sqrt(single.covariance[0, 0])).all() and np.isfinite(unsure).all()


def test_a_joint_whose_replay_ran_away_leaves_the_others_alone() -> None:
    rng = np.random.default_rng(0)
    z, slopes = rng.normal(size=(WINDOWS, SCORED, JOINTS)), rng.normal(size=(SHIFTS, WINDOWS, SCORED, JOINTS))
    far = z.copy()
    far[..., 0] = 1e3
    steps = [
        Normal.of(each, np.zeros((0, *z.shape)), slopes, np.zeros((SHIFTS, JOINTS)), 1.0).solve()[1]
        for each in (z, far)
    ]
    assert np.isfinite(steps[1]).all()
    np.testing.assert_array_equal(steps[0][:, 1:], steps[1][:, 1:])
