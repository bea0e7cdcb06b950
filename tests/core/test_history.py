from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gsl.core.angles import decode, encode
from gsl.core.history import History, Window, tilt, windows
from gsl.core.layout import Layout
from gsl.core.observation import Senses, observations, read_sensors
from gsl.core.scaling import scaling
from gsl.core.split import split
from gsl.core.trajectory import Trajectory
from gsl.core.transitions import FALLING, transitions

RNG = np.random.default_rng(0)


def an_episode(steps: int = 40, n: int = 3, *, fell: bool = False) -> Trajectory:
    names = ["gyro.x", "gyro.y", "gyro.z", "foot_force.left", "foot_force.right"]
    sensors = {name: RNG.normal(size=steps + 1) for name in names}
    turn = RNG.normal(size=(steps + 1, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    sensors |= {f"base.orientation.{axis}": turn[:, index] for index, axis in enumerate("xyzw")}
    down = np.zeros(steps + 1, dtype=bool)
    down[-1] = fell
    x, v = RNG.normal(size=(2, steps + 1, n))
    return Trajectory(0.02 * np.arange(steps + 1), RNG.normal(size=(steps, n)), x, v, fell=down, sensors=sensors)


LAYOUT = Layout(
    ("a", "b", "c"), {"position": 3, "velocity": 3, "gyro": 3, "foot_force": 2, "base.orientation": 4}, 0.02
)


@pytest.mark.parametrize(
    "history", [History(0), History(1), History(3, ("gyro", "tilt", "foot_force")), History(1, ("tilt",), 4)]
)
def test_the_window_of_a_running_episode_is_that_of_its_recording(history: History) -> None:
    episode = an_episode()
    recorded = read_sensors(episode, history.sensors)
    ticks = np.arange(history.span, len(episode))
    expected = windows(history, episode.position, episode.action, recorded, ticks)
    window, seen = Window(history, 3), []
    for tick in range(len(episode)):
        window.see(episode.position[tick], recorded[tick])
        seen.append(window.complete(episode.action[tick]).copy())
        window.remember(episode.action[tick])
    np.testing.assert_allclose(seen[history.span :], expected, atol=1e-15)
    assert expected.shape[1] == history.size(3)


def test_an_episode_that_begins_at_rest_has_windows_of_its_first_ticks() -> None:
    episode, history = an_episode(), History(3, ("gyro",), rested=True)
    window, seen = Window(history, 3), []
    for tick in range(len(episode)):
        window.see(episode.position[tick], read_sensors(episode, history.sensors)[tick])
        seen.append(window.complete(episode.action[tick]).copy())
        window.remember(episode.action[tick])
    samples = transitions([episode], history, 2, carried_out=False)
    np.testing.assert_allclose(samples.windows, seen[:-1], atol=1e-15)
    np.testing.assert_allclose(samples.change, episode.position[2:] - episode.position[:-2], atol=1e-15)
    later = transitions([episode], replace(history, rested=False), 2, carried_out=False)
    np.testing.assert_array_equal(samples.windows[3:], later.windows)


def test_before_the_first_tick_the_robot_stood_still() -> None:
    window = Window(History(2), 2)
    window.see(np.array([0.1, 0.2]), ())  # what it is told first is farther away than a robot that rests can be
    first = window.complete(np.array([0.14, 0.5])).reshape(-1, 2)
    np.testing.assert_allclose(first, [[0.04, 0.3], [0.1, 0.2], [0, 0], [0, 0], [0.04, 0.0], [0.04, 0.0]])


def test_a_window_does_not_move_with_the_robot_but_for_the_positions_themselves() -> None:
    episode, history, shift = an_episode(), History(2), np.array([0.3, -0.2, 0.1])
    none, ticks = np.zeros((len(episode) + 1, 0)), np.arange(2, 20)
    here = windows(history, episode.position, episode.action, none, ticks)
    there = windows(history, episode.position + shift, episode.action + shift, none, ticks)
    moved = np.zeros(history.size(3))
    moved[3:6] = shift
    np.testing.assert_allclose(there - here, np.tile(moved, (len(ticks), 1)), atol=1e-14)


def test_an_upright_body_has_no_tilt_whatever_its_heading() -> None:
    np.testing.assert_allclose(tilt(0.0, 0.0, np.sin(0.4), np.cos(0.4)), 0.0, atol=1e-15)


def test_a_body_that_leans_forward_sees_up_behind() -> None:
    np.testing.assert_allclose(tilt(0.0, np.sin(0.1), 0.0, np.cos(0.1)), [-np.sin(0.2), 0.0], atol=1e-15)


def test_observations_and_recorded_columns_give_the_same_senses() -> None:
    episode, sensors = an_episode(), ("gyro", "tilt", "foot_force")
    senses = Senses(LAYOUT, sensors)
    rows = observations(episode, LAYOUT)
    np.testing.assert_allclose([senses.read(row) for row in rows], read_sensors(episode, sensors))
    np.testing.assert_array_equal([senses.position(row) for row in rows], episode.position)


def test_a_column_that_was_not_recorded_is_named() -> None:
    episode = an_episode()
    del episode.sensors["gyro.y"]  # type: ignore[attr-defined]
    with pytest.raises(KeyError, match=r"gyro\.y"):
        read_sensors(episode, ("gyro",))


def test_transitions_add_up_to_the_motion() -> None:
    episode = an_episode()
    data = transitions([episode], History(0), 1, carried_out=False)
    np.testing.assert_allclose(data.change.sum(axis=0), episode.position[-1] - episode.position[0])


def test_transitions_end_before_a_fall() -> None:
    count = len(transitions([an_episode()], History(2), 1, carried_out=False).change)
    fallen = len(transitions([an_episode(fell=True)], History(2), 1, carried_out=False).change)
    assert count - fallen == FALLING


@pytest.mark.parametrize("encoding", ["plain", "sincos"])
def test_decode_undoes_encode(encoding: str) -> None:
    angles = RNG.uniform(-3.1, 3.1, size=(20, 4))
    np.testing.assert_allclose(decode(encode(angles, encoding), encoding), angles, atol=1e-12)


def test_scaling_gives_zero_mean_and_unit_variance_and_can_be_undone() -> None:
    values = RNG.normal(3.0, 5.0, size=(100, 4))
    values[:, 2] = 7.0
    scales = scaling(values)
    np.testing.assert_allclose(scales.apply(values).mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(scales.apply(values).std(axis=0), [1, 1, 0, 1], atol=1e-12)
    np.testing.assert_allclose(scales.undo(scales.apply(values)), values)


@pytest.mark.parametrize("first", range(0, 6))
@pytest.mark.parametrize("second", range(0, 6))
def test_a_split_parts_all_trajectories_and_holds_out_of_every_group_of_two(first: int, second: int) -> None:
    groups = [True] * first + [False] * second
    parts = split(groups, 0.2, np.random.default_rng(1))
    assert sorted([*parts.training, *parts.heldout]) == list(range(len(groups)))
    assert bool(parts.heldout) == (len(groups) > 1)
    for group in (True, False):
        if groups.count(group) >= 2:
            assert {group} <= {groups[index] for index in parts.heldout}
            assert {group} <= {groups[index] for index in parts.training}
