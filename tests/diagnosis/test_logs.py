"""Logs that cannot be diagnosed are refused in one line that says what, where and what to do."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from swinging_arm import PERIOD, arm

from gsl.core.body import lump
from gsl.core.plant import nominal
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.log.files import check_log, log_files, on_ground, read_logs
from gsl.diagnosis.log.floor import roughness
from gsl.diagnosis.log.log import cut_log
from gsl.diagnosis.log.residual import Comparison
from gsl.errors import GslError
from gsl.robots.nao import nao
from gsl.storage.trajectories import write
from gsl.worlds.held import Held

NAO = lump(nao())
REST = np.array([0.5 * NAO.stance.get(joint, 0.0) for joint in NAO.controlled])


def log(ticks: int = 100) -> Batch:
    waves = 0.1 * np.sin(0.1 * np.arange(ticks + 1))[:, None]
    position = REST + waves
    episode = Trajectory(0.02 * np.arange(ticks + 1), position[:-1], position, np.zeros_like(position))
    return Batch((episode,), NAO.controlled, 0.02, {"robot": "nao", "role": "imported"})


def changed(batch: Batch, change: Callable[[Trajectory], Trajectory]) -> Batch:
    return replace(batch, episodes=tuple(change(episode) for episode in batch.episodes))


def degrees(episode: Trajectory) -> Trajectory:
    return replace(episode, action=np.degrees(episode.action), position=np.degrees(episode.position))


def constant(episode: Trajectory) -> Trajectory:
    return replace(episode, action=np.zeros_like(episode.action) + REST)


def flipped(episode: Trajectory) -> Trajectory:
    return replace(episode, position=-3.0 * episode.position)


def spinning(episode: Trajectory) -> Trajectory:
    return replace(episode, velocity=np.degrees(np.gradient(episode.position, 0.02, axis=0)))


def standing(episode: Trajectory) -> Trajectory:
    force = np.full(len(episode.time), 20.0)
    return replace(episode, sensors={"foot_force.left": force, "foot_force.right": force})


def test_a_good_log_passes() -> None:
    check_log(log(), NAO, "good")
    assert not on_ground(log()) and on_ground(changed(log(), standing))


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (changed(log(), degrees), "are these degrees?"),
        (changed(log(), spinning), "times the slope of position"),
        (changed(log(), flipped), "is the zero or the sign another?"),
        (changed(log(), constant), "no command ever changes"),
        (log(20), "too short"),
        (changed(log(), standing), "a walk needs base.position"),
        (replace(log(), joints=("other", *NAO.controlled[1:])), "another robot? It lacks LHipYawPitch"),
    ],
)
def test_a_bad_log_is_one_clear_line(bad: Batch, words: str) -> None:
    with pytest.raises(GslError) as caught:
        check_log(bad, NAO, "my_log.parquet")
    message = str(caught.value)
    assert message.startswith("my_log.parquet: ") and words in message and "\n" not in message


def test_a_hole_in_time_is_refused() -> None:
    batch = log()
    time = batch.episodes[0].time.copy()
    time[40:] += 0.3
    with pytest.raises(GslError, match=r"step 39: 0\.32 s to the next row"):
        check_log(replace(batch, episodes=(replace(batch.episodes[0], time=time),)), lump(NAO), "log")


def test_a_folder_of_files_is_one_log(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write(tmp_path / f"{name}.parquet", log())
    assert [path.name for path in log_files(str(tmp_path))] == ["a.parquet", "b.parquet"]
    assert len(read_logs(str(tmp_path))) == 2
    write(tmp_path / "c.parquet", replace(log(), control_period=0.01))
    with pytest.raises(GslError, match=r"c\.parquet.*another control period"):
        read_logs(str(tmp_path))


@pytest.mark.parametrize(("group", "unit"), [("velocity_command", "rad/s"), ("torque_command", "N·m")])
def test_commands_beside_the_positions_are_taken_unless_no_joint_could_follow_them(group: str, unit: str) -> None:
    def beside(value: float) -> Batch:
        def with_column(episode: Trajectory) -> Trajectory:
            values = np.full(len(episode.time), value)
            values[-1] = np.nan  # after the last action there is no command
            return replace(episode, sensors={**episode.sensors, f"{group}.LKneePitch": values})

        return changed(log(), with_column)

    check_log(beside(0.0), NAO, "log")
    check_log(beside(-1.5), NAO, "log")
    with pytest.raises(GslError, match=f"{group}.LKneePitch reaches 1.6e\\+04, the joint's limit is .* {unit}; "):
        check_log(beside(-16000.0), NAO, "log")


def test_a_log_whose_targets_rest_is_no_log_without_commands_where_there_are_others() -> None:
    def by_torque(episode: Trajectory) -> Trajectory:
        return replace(constant(episode), sensors={"torque_command.LKneePitch": np.sin(0.1 * np.arange(101))})

    check_log(changed(log(), by_torque), NAO, "log")


def test_joints_that_shake_under_steps_do_not_pass_for_noise() -> None:
    """Nothing is repeated and no command rests for long: white noise alone is the floor of a joint that shakes."""
    rng, noise, time = np.random.default_rng(3), 1.5e-3, 0.02 * np.arange(601)
    steps = np.repeat(rng.uniform(-0.1, 0.1, (30, 3)), 20, axis=0)
    fast = 0.1 * np.sin(2 * np.pi * 5.0 * time[:-1])  # commanded, so no shaking
    commands = REST + np.zeros((600, len(REST)))
    commands[:, :3] += steps
    commands[:, 3] += fast
    still = lfilter([0.0, 0.09], [1.0, -1.4, 0.49], np.vstack([commands[:1], commands]) - REST, axis=0) + REST
    position = still + noise * rng.standard_normal(still.shape)
    position[:, 0] += 0.012 * np.sin(2 * np.pi * 13.0 * time)
    batch = Batch((Trajectory(time, commands, position, np.zeros_like(position)),), NAO.controlled, 0.02, {})
    cut = cut_log(batch, NAO)
    assert list(np.flatnonzero(cut.noise.restless)) == list(np.flatnonzero(cut.comparison.shaking)) == [0]
    assert 0.7 * noise < cut.noise.sd[0] < 2.0 * noise < 0.6 * roughness(cut.records)[0]
    assert cut.noise.sd[1:3] == pytest.approx(roughness(cut.records)[1:3])


LATE = ([0.0, 0.09], [1.0, -1.4, 0.49])  # how a joint follows, as a filter


def compare_straight_on(
    more: Callable[[np.ndarray, np.ndarray, np.ndarray], None],
    sensors: Mapping[str, np.ndarray] | None = None,
    noise: float = 1.5e-3,
    seeds: tuple[int, ...] = (4,),
) -> Comparison:
    """Return how logs of slow triangles and a wave are compared, to which `more` adds something."""
    time, episodes = 0.02 * np.arange(901), []
    for seed in seeds:
        commands = REST + np.zeros((900, len(REST)))
        triangle = 0.2 * (np.abs(np.mod(time[:-1], 3.0) - 1.5) - 0.75)
        commands[:, :3] += np.stack([triangle, triangle, 0.2 * np.sin(2 * np.pi * 0.4 * time[:-1])], axis=1)
        position = lfilter(*LATE, np.vstack([commands[:1], commands]) - REST, axis=0) + REST
        more(time + 0.05 * seed, commands, position)
        position += noise * np.random.default_rng(seed).standard_normal(position.shape)
        episodes.append(Trajectory(time, commands, position, np.zeros_like(position), sensors=dict(sensors or {})))
    return cut_log(Batch(tuple(episodes), NAO.controlled, 0.02, {}), NAO).comparison


def straight_on(*arguments: Any, **more: Any) -> list[int]:
    """Return which joints shake there."""
    return list(np.flatnonzero(compare_straight_on(*arguments, **more).shaking))


def swing(time: np.ndarray, _: np.ndarray, position: np.ndarray) -> None:
    position[:, 0] += 0.008 * np.sin(2 * np.pi * 6.0 * time)


def test_joints_that_shake_slowly_do_not_pass_for_a_gap() -> None:
    """At 6 Hz a joint is no rougher than a calm one: it moves though its commands are smooth and explain nothing."""
    assert straight_on(swing) == [0]
    assert straight_on(swing, seeds=(4, 5)) == [0]  # another phase each time


def carry(time: np.ndarray, commands: np.ndarray, position: np.ndarray) -> None:
    swing(time, commands, position)
    position[:, 1] += 0.0025 * np.sin(2 * np.pi * 6.0 * time)


def test_the_floor_of_a_joint_holds_how_a_shaking_neighbour_carries_it_along() -> None:
    """Twice: the replay swings as well, at another phase. Most of it shows beside a parabola and the command."""
    still, carried = compare_straight_on(lambda *_: None), compare_straight_on(carry)
    assert list(np.flatnonzero(carried.shaking)) == [0] and not still.shaking.any()
    assert np.hypot(still.floor[1], 0.7 * 0.0025) < carried.floor[1] < np.hypot(still.floor[1], 1.1 * 0.0025)
    np.testing.assert_allclose(carried.floor[2:], still.floor[2:], rtol=0.15)
    np.testing.assert_array_equal(still.carried, 0.0)


def test_simulated_logs_get_the_noise_without_what_shaking_joints_do_to_others() -> None:
    carried = compare_straight_on(carry)
    np.testing.assert_allclose(np.hypot(carried.noise, carried.carried), carried.floor)
    assert carried.carried[1] > 0.001 and carried.noise[1] < 0.002


@pytest.mark.parametrize("mover", [0, 2])
def test_how_other_commands_bend_a_joint_is_no_noise_beside_one_that_shakes(mover: int) -> None:
    """Joints move one at a time: each rests while others move, one that shakes or another one."""

    def bend_at_rest(time: np.ndarray, commands: np.ndarray, position: np.ndarray) -> None:
        commands[:, 0], position[:, 0] = REST[0], REST[0]
        wave = 0.2 * np.sin(2 * np.pi * 1.5 * time) * (time < 12.0)
        commands[:, mover] = REST[mover] + wave[:-1]
        position[:, mover] = REST[mover] + (bent := lfilter(*LATE, np.r_[0.0, wave[:-1]]))
        commands[:, 5], position[:, 5] = REST[5], REST[5] + 0.03 * bent
        swing(time, commands, position)

    bent = compare_straight_on(bend_at_rest)
    assert bent.shaking[0] and bent.carried[5] < 0.001  # it moves by 0.004


def test_what_differs_between_repeats_stays_the_floor_beside_a_joint_that_shakes() -> None:
    def stray(time: np.ndarray, commands: np.ndarray, position: np.ndarray) -> None:
        swing(time, commands, position)
        position[:, 4] += 0.004 if time[0] > 0.22 else -0.004

    assert compare_straight_on(stray, seeds=(4, 5)).floor[4] > 0.005


def test_what_repeats_is_no_shaking() -> None:
    assert straight_on(lambda time, *rest: swing(time - time[0], *rest), seeds=(4, 5)) == []


def test_a_joint_without_torque_does_not_shake() -> None:
    def sway(time: np.ndarray, _: np.ndarray, position: np.ndarray) -> None:
        position[300:, 0] += 0.02 * np.sin(2 * np.pi * 3.0 * time[300:])

    on = {f"enabled.{joint}": np.where(np.arange(901) < 300, 1.0, 0.0) for joint in NAO.controlled}
    assert straight_on(sway) == [0]
    assert straight_on(sway, on) == []


def bend(time: np.ndarray, commands: np.ndarray, position: np.ndarray) -> None:
    """Let a joint be late on a command that is no parabola."""
    commands[:, 2] = REST[2] + 0.6 * np.sin(2 * np.pi * 0.4 * time[:-1])
    position[:, 2] = lfilter(*LATE, commands[[0, *range(900)], 2] - REST[2]) + REST[2]


def stick(time: np.ndarray, commands: np.ndarray, position: np.ndarray) -> None:
    position[:, 1] = np.round(position[:, 1] / 0.004) * 0.004


def loosen(time: np.ndarray, commands: np.ndarray, position: np.ndarray) -> None:
    """Let a joint lag by a dead band of 0.06 rad, which it crosses wherever its command turns round."""
    commands[:, 2] = REST[2] + 0.2 * np.sin(2 * np.pi * 0.8 * time[:-1])
    at = REST[2]
    for t, wanted in enumerate(commands[[0, *range(900)], 2]):
        at = position[t, 2] = np.clip(at, wanted - 0.03, wanted + 0.03)


def push(time: np.ndarray, commands: np.ndarray, position: np.ndarray) -> None:
    position[:, 3] += 0.05 * np.exp(-(((np.arange(901) - 420.0) / 8.0) ** 2))


def climb(time: np.ndarray, commands: np.ndarray, position: np.ndarray) -> None:
    """Step up and up, each step before the last one has been answered."""
    commands[:] = REST
    commands[:, 0] += 0.1 * (np.arange(900) // 26)
    position[:] = lfilter(*LATE, np.vstack([commands[:1], commands]) - REST, axis=0) + REST


def ring(time: np.ndarray, commands: np.ndarray, position: np.ndarray) -> None:
    """Let a joint swing after each of its steps; others rest."""
    since = np.mod(np.arange(901), 60)
    commands[:] = REST
    commands[:, 0] += 0.1 * (np.arange(900) // 60 % 2)
    position[:] = np.vstack([commands[:1], commands])
    position[:, 0] += 0.1 * np.exp(-since / 6.0) * np.cos(0.5 * since)


def test_a_refusal_names_the_angle_that_is_beyond_the_limits() -> None:
    low = NAO.joint("LKneePitch").lower - 3.0
    at = list(NAO.controlled).index("LKneePitch")

    def beyond(episode: Trajectory) -> Trajectory:
        position = episode.position.copy()
        position[7, at], position[8, at] = low, abs(low) + 0.1  # the second is larger, and less far beyond
        return replace(episode, position=position)

    with pytest.raises(GslError, match=rf"position.LKneePitch reaches {low:.3g}, beyond"):
        check_log(changed(log(), beyond), NAO, "log")


@pytest.mark.parametrize("parallel", [True, False])
def test_a_joint_that_its_neighbour_takes_along_does_not_shake(parallel: bool) -> None:
    """One joint moves at a time, and gravity and inertia bend the servo of the other."""
    robot, time, rng = arm(), PERIOD * np.arange(150), np.random.default_rng(0)
    shoulder, elbow = robot.joints
    robot = replace(robot, joints=(shoulder, replace(elbow, axis=shoulder.axis))) if parallel else robot
    waves = [np.sin(2 * np.pi * 0.6 * time), np.sin(2 * np.pi * (0.5 + 0.7 * time) * time)]
    paths = [0.5 * np.outer(wave * np.minimum(1.0, time / 0.3), side) for wave in waves for side in np.eye(2)] * 2
    played = Held.of(nominal(robot), 0.0005, PERIOD).play(paths, [path[0] for path in paths], 50)
    noisy = [path + 3e-4 * rng.standard_normal(path.shape) for path in played]
    episodes = [
        Trajectory(PERIOD * np.arange(151), targets, position, np.zeros_like(position))
        for targets, position in zip(paths, noisy, strict=True)
    ]
    finer = replace(robot, encoder_step=5e-4)
    assert not cut_log(Batch(tuple(episodes), robot.controlled, PERIOD, {}), finer).comparison.shaking.any()


@pytest.mark.parametrize(
    ("more", "noise"),
    [(bend, 2e-4), (stick, 1.5e-3), (loosen, 2e-4), (push, 1.5e-3), (climb, 1.5e-3), (ring, 1.5e-3)],
)
def test_a_calm_joint_does_not_shake(more: Callable[[np.ndarray, np.ndarray, np.ndarray], None], noise: float) -> None:
    assert straight_on(more, noise=noise) == []
