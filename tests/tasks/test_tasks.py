"""What episodes are worth."""

import math

import numpy as np
import pytest
from bodies import world

from gsl.core.interfaces import REAL, SIM
from gsl.core.trajectory import Trajectory
from gsl.tasks.arm import Arm
from gsl.tasks.walk import Walk

LAYOUT = world(floating=False).layout


def observed(**parts: np.ndarray) -> np.ndarray:
    observation = np.zeros(LAYOUT.size)
    for part, values in parts.items():
        observation[LAYOUT[part.replace("_", ".")]] = values
    return observation


def walk_value(role: str, places: list[float], *, fell: bool) -> float:
    task, states = Walk(duration=2.0), [observed(base_position=[x, 0.0, 0.3]) for x in places]
    run = task.start(LAYOUT, states[0], role)
    last = len(states) - 2
    steps = enumerate(zip(states[:-1], states[1:], strict=True))
    return sum(run.step(before, after, fell and k == last).reward for k, (before, after) in steps)


@pytest.mark.parametrize("role", [REAL, SIM])
def test_a_walk_is_worth_its_mean_forward_speed_over_the_planned_time(role: str) -> None:
    assert walk_value(role, [0.1, 0.2, 0.15, 0.7], fell=False) == pytest.approx(0.6 / 2.0)


def test_a_fall_costs_15_cm_a_second_in_simulation_and_everything_in_reality() -> None:
    assert walk_value(SIM, [0.0, 0.2, 0.6], fell=True) == pytest.approx(0.3 - 0.15)
    assert walk_value(REAL, [0.0, 0.2, 0.6], fell=True) == pytest.approx(0.0, abs=1e-15)


def arm(*lifts: float) -> np.ndarray:
    positions = np.zeros(15)
    positions[[11, 13]] = math.pi / 2 - np.radians(lifts)
    return observed(position=positions)


def test_the_arms_reward_is_the_inverse_square_of_the_distance_in_degrees() -> None:
    run = Arm().start(LAYOUT, arm(0.0, 0.0), SIM)
    assert run.step(arm(0.0, 0.0), arm(42.0, 41.0), False).reward == pytest.approx(1.0 / (3.0**2 + 4.0**2))


def test_within_a_degree_the_reward_grows_no_more() -> None:
    run = Arm().start(LAYOUT, arm(0.0, 0.0), SIM)
    assert run.step(arm(0.0, 0.0), arm(44.9, 44.9), False).reward == pytest.approx(1.0)
    assert run.step(arm(0.0, 0.0), arm(44.0, 44.0), False).reward == pytest.approx(0.5)


def test_the_episode_ends_when_one_arm_is_above_the_goal() -> None:
    run = Arm().start(LAYOUT, arm(0.0, 0.0), SIM)
    assert not run.step(arm(0.0, 0.0), arm(44.9, 44.9), False).ended
    above = run.step(arm(0.0, 0.0), arm(44.9, 45.1), False)
    assert above.ended and above.reward == 0.0


def test_the_distance_reported_is_the_last_one() -> None:
    position = np.array([arm(0.0, 0.0)[LAYOUT["position"]], arm(41.0, 42.0)[LAYOUT["position"]]])
    trajectory = Trajectory(np.array([0.0, 0.02]), position[:1], position, 0.0 * position)
    outcome = Arm().outcome(LAYOUT, trajectory)
    assert outcome["distance [deg]"] == pytest.approx(5.0)
    assert outcome["mean distance [deg]"] == pytest.approx(0.5 * (5.0 + 45.0 * 2.0**0.5))
    assert outcome["above [share]"] == 0.0
