import numpy as np
import pytest
from bodies import world

from gsl.policies.linear import Linear

LAYOUT = world(floating=False).layout
POLICY = Linear(start_at={"LShoulderPitch": 1.57, "RShoulderPitch": 1.57})
SHOULDERS = [11, 13]


def observed(left: float, right: float) -> np.ndarray:
    observation = np.zeros(LAYOUT.size)
    observation[SHOULDERS] = left, right
    return observation


def test_two_joints_make_ten_parameters() -> None:
    assert len(POLICY.names) == len(POLICY.initial) == len(POLICY.scale) == 10
    assert len(set(POLICY.names)) == 10


def test_the_start_policy_does_not_move() -> None:
    run = POLICY.start(POLICY.initial, LAYOUT)
    np.testing.assert_array_equal(run.act(observed(0.3, -0.2)), POLICY.posture(POLICY.initial, LAYOUT))


def test_it_is_linear_in_the_positions_now_and_one_step_ago() -> None:
    parameters = np.random.default_rng(0).standard_normal(10)
    weights, offset = parameters[:8].reshape(2, 4), parameters[8:]
    run = POLICY.start(parameters, LAYOUT)
    first = run.act(observed(0.1, 0.2))[SHOULDERS]
    np.testing.assert_allclose(first, weights @ [0.1, 0.2, 0.1, 0.2] + offset)
    second = run.act(observed(0.3, 0.4))[SHOULDERS]
    np.testing.assert_allclose(second, weights @ [0.3, 0.4, 0.1, 0.2] + offset)


def test_names_say_which_weight_is_which() -> None:
    for index, name in enumerate(POLICY.names[:8]):
        response = POLICY.start(np.eye(10)[index], LAYOUT)
        response.act(observed(1.0, 10.0))
        moved = response.act(observed(100.0, 1000.0))[SHOULDERS]
        target, source = name.split("_from_")
        joint, when = source.rsplit("_", 1)
        value = {"now": (100.0, 1000.0), "before": (1.0, 10.0)}[when][int(joint.startswith("R"))]
        assert moved[int(target.startswith("R"))] == pytest.approx(value)


def test_other_joints_stay_where_they_start() -> None:
    policy = Linear(start_at={"LHipPitch": -0.4}, joints=("LShoulderPitch",))
    action = policy.start(np.ones(3), LAYOUT).act(observed(0.5, 0.0))
    assert action[2] == -0.4 and np.count_nonzero(action) == 2
