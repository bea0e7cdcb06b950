"""Learning a servo from a pendulum's log: what is true is recovered, what is not there is not, bad logs are refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gsl.core.plant import Plant, nominal
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.log.log import Log, cut_log
from gsl.diagnosis.log.records import slope
from gsl.effects.effect import apply_all, build
from gsl.errors import ConfigError, InputError
from gsl.models.servo import ServoModel, neutral, units, with_group, without_group
from gsl.robots.go2 import go2
from gsl.robots.pendulum import pendulum
from gsl.training.learn_servo import LearnedServo, document, learn_servo
from gsl.training.servo_split import leave_out, split
from gsl.worlds.bullet import BulletEnv, BulletWorld
from gsl.worlds.fits import fitting_step
from gsl.worlds.held import Held

pytestmark = pytest.mark.slow

ROBOT, PERIOD = pendulum(), 0.02
NOISE, STEP = 1e-3, 0.002
SLOW = {
    "servo_gain": {"kp": 0.7},
    "command_latency": {"delay": 0.03},
    "coulomb_friction": {"torque": 0.03},
}


def commands(rng: np.random.Generator, period: float, seconds: float, size: float = 1.0) -> np.ndarray:
    """A motion of a few sines and steps [rad], shape (T, 1)."""
    time = np.arange(round(seconds / period)) * period
    waves = sum(
        rng.uniform(0.1, 0.5) * np.sin(2 * np.pi * rng.uniform(0.2, 2.0) * time + rng.uniform(0.0, 6.0))
        for _ in range(3)
    )
    steps = rng.uniform(-0.4, 0.4, size=8)[np.minimum(7, (8 * np.arange(len(time))) // len(time))]
    return size * (waves + steps)[:, None]


def log(plant: Plant, *, period: float = PERIOD, motions: int = 10, seconds: float = 4.0, size: float = 1.0,
        noise: float = NOISE, seed: int = 0, rests: bool = False) -> Batch:  # fmt: skip
    """What a robot that is `plant` logs of motions of its own, whose second half it may rest."""
    rng = np.random.default_rng(seed)
    paths = [commands(rng, period, seconds, size) for _ in range(motions)]
    for path in paths if rests else []:
        path[len(path) // 2 :] = path[len(path) // 2]
    played = Held.of(plant, fitting_step(STEP, period), period).play(
        paths, [path[0] for path in paths], round(1.0 / period)
    )
    episodes = []
    for path, position in zip(paths, played, strict=True):
        seen = position + noise * rng.standard_normal(position.shape)
        time = period * np.arange(len(seen))
        episodes.append(Trajectory(time, path, seen, slope(seen, period)))
    labels = [{"policy": f"motion_{k}"} for k in range(motions)]
    return Batch(tuple(episodes), ROBOT.controlled, period, metadata={"episodes": labels})


def real(effects: dict[str, Any]) -> Plant:
    return apply_all(nominal(ROBOT), build(effects))


def prepared(effects: dict[str, Any], **how: Any) -> Log:
    return cut_log(log(real(effects), **how), ROBOT)


def learned(exp: Log, *, threads: int = 1, step: float = STEP) -> LearnedServo:
    return learn_servo(exp, nominal(ROBOT), step, labelled=False, seed=1, threads=threads)


@pytest.fixture(scope="module")
def slow() -> LearnedServo:
    return learned(prepared(SLOW))


def test_gain_lag_and_friction_are_recovered(slow: LearnedServo) -> None:
    assert slow.before["all"] > 10.0
    assert slow.after["all"] < 1.3
    assert not slow.worse


def with_beside(batch: Batch, plant: Plant) -> Batch:
    """The same motions with desired speeds and feed-forward torques beside the targets."""
    rng, episodes = np.random.default_rng(7), []
    for episode in batch.episodes:
        others = np.hstack([5.0 * commands(rng, PERIOD, 4.0), 0.2 * commands(rng, PERIOD, 4.0)])
        path = Held.of(plant, STEP, PERIOD).play([np.hstack([episode.action, others])], [episode.action[0]], 1)[0]
        position = path + NOISE * rng.standard_normal(path.shape)
        columns = dict(
            zip(("velocity_command.joint", "torque_command.joint"), np.vstack([others, others[-1:]]).T, strict=True)
        )
        episodes.append(replace(episode, position=position, velocity=slope(position, PERIOD), sensors=columns))
    return replace(batch, episodes=tuple(episodes))


def test_a_servo_is_learned_beneath_which_other_commands_act() -> None:
    batch = with_beside(log(real(SLOW)), real(SLOW))
    servo = learned(cut_log(batch, ROBOT))
    assert servo.before["all"] > 10.0
    assert servo.after["all"] < 1.5


def test_a_report_says_what_held_out_motions_say(slow: LearnedServo) -> None:
    report = document(slow)
    assert report["floors_before"] == slow.before["all"]
    assert report["floors_after"] == slow.after["all"]
    assert report["learned"] and report["whole_motions"]


def test_nothing_is_learned_where_nothing_differs() -> None:
    null = learn_servo(prepared({}), nominal(ROBOT), STEP, labelled=False, seed=1, threads=1, members=2)
    assert null.before["all"] == pytest.approx(1.0, abs=0.15)
    assert null.after["all"] < null.before["all"] + 0.05
    for model in (null.model, null.further[0].model):  # a further member learns nothing that the first was refused
        assert not model.changes("all")


def pushed(motion: np.ndarray, time: float) -> np.ndarray:
    """What no effect says: friction in one direction alone, and drag that grows with the square of speed [N·m]."""
    v = motion[1]
    return -0.04 * (1.0 + np.tanh(v / 0.1)) - 0.006 * v * np.abs(v)


def played_by_bullet(plant: Plant, *, motions: int = 8, seconds: float = 4.0) -> Batch:
    """What a robot logs in the other engine, which knows of a user's own torques."""
    world = BulletWorld(robot="pendulum", effects={}, floating=False, step=STEP, period=PERIOD)
    rng, env, episodes = np.random.default_rng(3), BulletEnv(world, plant), []
    for _ in range(motions):
        path = commands(rng, PERIOD, seconds)
        seen = [env.reset(seed=0, options={"posture": path[0]})[0]]
        seen += [env.step(action)[0] for action in path]
        position = np.array(seen)[:, env.layout["position"]]
        position = position + NOISE * rng.standard_normal(position.shape)
        episodes.append(Trajectory(PERIOD * np.arange(len(position)), path, position, slope(position, PERIOD)))
    env.close()
    labels = [{"policy": f"motion_{k}"} for k in range(motions)]
    return Batch(tuple(episodes), ROBOT.controlled, PERIOD, metadata={"episodes": labels})


def test_a_torque_hook_is_refused_where_it_would_be_left_out() -> None:
    with pytest.raises(ConfigError, match="effects: the torque hook pushed acts in Bullet alone"):
        Held.of(replace(nominal(ROBOT), hook=pushed), STEP, PERIOD)


def test_a_network_learns_what_no_number_says() -> None:
    exp = cut_log(played_by_bullet(replace(nominal(ROBOT), hook=pushed)), ROBOT)
    servo = learned(exp)
    assert servo.model.network["last"].any()
    assert servo.before["all"] > 10.0
    assert servo.after["all"] < 0.25 * servo.before["all"]


def test_a_group_that_gets_worse_keeps_its_servo() -> None:
    """The motions that are held out come from another robot than those that are fitted."""
    fitted, held = log(real({"servo_gain": {"kp": 0.5}})), log(real({}), seed=1)
    labels = [{**label, "robot": name} for name, batch in (("soft", fitted), ("plain", held)) for label in about(batch)]
    both = replace(fitted, episodes=(*fitted.episodes, *held.episodes), metadata={"episodes": labels})
    exp = cut_log(both, ROBOT, held_out={"robot": "plain"})
    servo = learn_servo(exp, nominal(ROBOT), STEP, labelled=True, seed=1, threads=1)
    assert servo.after == servo.before
    assert not any(values.any() for values in servo.model.numbers.values())
    assert not document(servo)["learned"]


def about(batch: Batch) -> list[dict[str, Any]]:
    labels: list[dict[str, Any]] = batch.metadata["episodes"]
    return labels


def test_known_conditions_are_no_news() -> None:
    """One servo at two firmware gains: what is learned is the rest, and holds at both."""
    soft = {"servo_gain": {"kp": 0.5}}
    late = {"command_latency": {"delay": 0.03}}
    first, second = log(real(late), motions=6), log(real(late | soft), motions=6, seed=1)
    labels = [*about(first), *({**label, "conditions": soft} for label in about(second))]
    both = replace(first, episodes=(*first.episodes, *second.episodes), metadata={"episodes": labels})
    servo = learned(cut_log(both, ROBOT))
    assert servo.after["all"] < 1.3 < servo.before["all"]
    assert servo.model.numbers["delay"][0] == pytest.approx(0.03, abs=0.005)
    assert servo.model.numbers["kp"][0] == pytest.approx(0.0, abs=0.1)


def at_gains(*friction: float) -> Batch:
    """What one robot logs at three firmware gains, with another friction at each [N·m]."""
    parts, labels = [], []
    for k, (kp, torque) in enumerate(zip((0.5, 1.0, 2.0), friction, strict=True)):
        gains = {"servo_gain": {"kp": kp}}
        parts.append(log(real(gains | {"coulomb_friction": {"torque": torque}}), motions=3, seconds=2.5, seed=k))
        labels += [{**label, "conditions": gains, "kp": kp} for label in about(parts[-1])]
    episodes = tuple(episode for part in parts for episode in part.episodes)
    return replace(parts[0], episodes=episodes, metadata={"episodes": labels})


@pytest.mark.parametrize(("friction", "holds"), [((0.04, 0.04, 0.04), True), ((0.0, 0.08, 0.0), False)])
def test_what_does_not_hold_at_a_gain_that_is_left_out_is_not_learned(
    friction: tuple[float, float, float], holds: bool
) -> None:
    servo = learned(cut_log(at_gains(*friction), ROBOT))
    assert document(servo)["learned"] is holds


def test_each_condition_is_left_out_in_turn() -> None:
    exp = cut_log(at_gains(0.0, 0.0, 0.0), ROBOT)
    parts = split(exp, labelled=False)
    folds = leave_out(exp, parts)
    gains = [{exp.records[k].conditions["servo_gain"]["kp"] for k in exp.pieces.record[fold.test]} for fold in folds]
    assert sorted(gains, key=min) == [{0.5}, {1.0}, {2.0}]
    for fold in folds:
        assert sorted(np.concatenate([fold.train, fold.judge, fold.test])) == list(range(len(exp.pieces)))
    labelled = cut_log(at_gains(0.0, 0.0, 0.0), ROBOT, held_out={"kp": 2.0})
    last = leave_out(labelled, split(labelled, labelled=False))[2]
    assert last.judge.size
    assert not np.isin(exp.pieces.record[last.judge], exp.pieces.record[last.test]).any()


def test_numbers_of_a_servo_that_torques_alone_drive_have_units() -> None:
    none = np.zeros(1)
    bare = nominal(ROBOT).with_servo(kp=none, kd=none, armature=none)
    assert all((values > 0.0).all() and np.isfinite(values).all() for values in units(bare).values())


def test_repeats_of_a_motion_are_on_one_side() -> None:
    once = log(real(SLOW), motions=4, seconds=3.0)
    twice = replace(once, episodes=once.episodes * 2, metadata={"episodes": about(once) * 2})
    exp = cut_log(twice, ROBOT)
    parts = split(exp, labelled=False)
    motion = np.array([repeat.motion for repeat in exp.repeats])[exp.pieces.record]
    train, judge, test = ({*motion[part]} for part in (parts.train, parts.judge, parts.test))
    assert train and judge and test and not (train & judge or judge & test or train & test)


@pytest.mark.parametrize("period", [0.05, 0.005, 0.001])
def test_slow_and_fast_logs_are_learned_from(period: float) -> None:
    """A step of 2 ms divides neither 5 ms nor 1 ms: replays take the nearest that does, or time would run wrong."""
    seconds, motions = (6.0, 6) if period > 0.01 else (2.5, 6)
    exp = prepared({"servo_gain": {"kp": 0.6}}, period=period, seconds=seconds, motions=motions)
    servo = learned(exp)
    assert servo.after["all"] < 0.5 * servo.before["all"]
    assert servo.model.numbers["kp"][0] == pytest.approx(np.log(0.6), abs=0.05)
    assert servo.model.numbers["delay"].max() <= 15 * fitting_step(STEP, period) + 1e-12  # what servos remember


def test_members_differ_by_what_the_log_leaves_open_and_neither_time_nor_threads_change_the_first(
    slow: LearnedServo,
) -> None:
    servo = learn_servo(prepared(SLOW), nominal(ROBOT), STEP, labelled=False, seed=1, threads=2, members=3)
    assert servo.after == slow.after
    for name, values in slow.model.arrays().items():  # the first is what it is by itself
        np.testing.assert_array_equal(servo.model.arrays()[name], values)
    gains = [float(model.numbers["kp"][0]) for model in (servo.model, *(member.model for member in servo.further))]
    assert len(set(gains)) == 3
    assert gains == pytest.approx([np.log(0.7)] * 3, abs=0.1)


def test_a_log_without_motion_is_refused() -> None:
    with pytest.raises(InputError, match="the log's joints hardly move: by .* mrad"):
        learned(prepared(SLOW, size=0.0))


def test_a_joint_that_shakes_is_learned_from_or_left_alone() -> None:
    """A stiff servo that measures late swings at rest; what is learned of its gain must not be worse than nothing."""
    exp = prepared({"sensor_delay": {"delay": 0.02}, "servo_gain": {"kp": 0.6}}, motions=6, rests=True)
    assert exp.comparison.shaking.all()
    servo = learned(exp)
    assert servo.after["all"] <= servo.before["all"]


def test_one_motion_alone_is_learned_from() -> None:
    servo = learned(prepared(SLOW, motions=1, seconds=30.0))
    assert servo.after["all"] <= servo.before["all"]


def test_a_motor_of_several_groups_is_of_the_smallest() -> None:
    model = neutral(nominal(go2()), np.random.default_rng(0))
    assert set(model.groups) == {"hips", "thighs", "calves"}
    assert set(model.group) == {0, 1, 2}


def test_a_group_is_taken_from_another_model() -> None:
    plant, rng = nominal(ROBOT), np.random.default_rng(0)
    old, new = neutral(plant, rng), neutral(plant, rng)
    new = replace(new, numbers={name: values + 0.1 for name, values in new.numbers.items()})
    back: ServoModel = with_group(new, old, "all")
    assert not any(values.any() for values in back.numbers.values())
    for name, values in back.network.items():
        np.testing.assert_array_equal(values, old.network[name])
    assert without_group(new, "all").on(plant).servo.kp == pytest.approx(plant.servo.kp)
