"""Logs of servos with desired speeds, feed-forward torques and gains are replayed as they were sent."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from commands import done
from swinging_arm import FEW, NOISE, PERIOD, arm, motions

from gsl.core.other_commands import gains_of, read_other_commands
from gsl.core.plant import nominal
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.diagnose import diagnose
from gsl.diagnosis.log.gains import list_added_gains, with_logged_gains
from gsl.diagnosis.log.log import cut_log
from gsl.diagnosis.log.records import cut_pieces
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.simulator import compare_with_bullet, simulator_of
from gsl.diagnosis.verdict.self_test import relog
from gsl.effects.effect import apply_all, build, together
from gsl.errors import GslError
from gsl.worlds.bullet import BulletWorld
from gsl.worlds.held import Held

pytestmark = pytest.mark.slow

STEP = 0.002
GROUPS = ("velocity_command", "torque_command", "kp_command", "kd_command")


def log(effects: Mapping[str, Any]) -> Batch:
    """What the arm with effects logs of commands of all kinds, its gains other ones from row to row."""
    robot, rng = arm(), np.random.default_rng(1)
    held = Held.of(apply_all(nominal(robot), build(effects)), STEP, PERIOD)
    return Batch(
        tuple(played(held, targets, rng) for targets in motions().values()),
        robot.controlled,
        PERIOD,
        {"episodes": [{"policy": name} for name in motions()], "world": {"step": STEP}},
    )


def played(held: Held, targets: np.ndarray, rng: np.random.Generator) -> Trajectory:
    time = PERIOD * np.arange(len(targets) + 1)
    waves = [size * np.sin(speed * time[:, None] + rng.uniform(0, 6, 2)) for size, speed in ((1.5, 7.0), (0.8, 11.0))]
    shares = [1.0 + size * np.sin(3.0 * time[:, None] + rng.uniform(0, 6, 2)) for size in (0.6, 0.3)]
    sent = np.hstack([targets, *(wave[:-1] for wave in (*waves, *shares))])
    path = held.play([sent], [targets[0]], settle=1)[0]
    position = path + NOISE * rng.standard_normal(path.shape)
    own = nominal(arm()).servo
    others = np.hstack([*waves, shares[0] * own.kp, shares[1] * own.kd])
    names = [f"{group}.{joint}" for group in GROUPS for joint in arm().controlled]
    return Trajectory(time, targets, position, 0.0 * position, sensors=dict(zip(names, others.T, strict=True)))


def residual(batch: Batch) -> float:
    """Root mean square of what a replay in the nominal arm leaves [floors]."""
    cut = cut_log(batch, arm())
    simulator = simulator_of(cut, nominal(arm()), STEP)
    z = cut.residual(simulator.simulate({}, no_shifts(2), cut.pieces))
    return float(np.sqrt(np.mean(z**2)))


def test_a_replay_leaves_noise_where_it_sends_what_was_sent() -> None:
    batch = log({})
    assert residual(batch) < 1.3
    for group in GROUPS:
        sensors = [{key: row for key, row in episode.sensors.items() if group not in key} for episode in batch.episodes]
        lacking = [replace(episode, sensors=left) for episode, left in zip(batch.episodes, sensors, strict=True)]
        assert residual(replace(batch, episodes=tuple(lacking))) > 5.0, group


def test_bullet_replays_the_same_commands() -> None:
    cut = cut_log(log({}), arm())
    simulator = simulator_of(cut, nominal(arm()), STEP)
    assert compare_with_bullet(cut, simulator, {}, no_shifts(2))["chain_rms_mrad"] < 2.0


def test_a_latency_delays_all_commands_and_is_named() -> None:
    result = diagnose(log({"command_latency": {"delay": 0.03}}), nominal(arm()), STEP, FEW, lambda phase: None)
    assert result.selection.chosen.names == ("command_latency",), result.verdict
    assert result.selection.chosen.parameters[0][0] == pytest.approx(0.03, rel=0.05)


def test_a_self_tests_log_is_no_step_ahead_of_desired_speeds() -> None:
    """It was half a step ahead, which no lag of damping makes up for here: chance gained as much as a cause."""
    cut = cut_log(replace(log({}), metadata={}), arm())  # of a robot, which has no step
    simulator = simulator_of(cut, nominal(arm()), STEP)
    accurate, step = simulator.accurate, simulator.log_step
    made = relog(cut, nominal(arm()), step, np.random.default_rng(0), accurate=accurate)
    pieces = cut_pieces(made, arm(), PERIOD, warm_up=cut.pieces.warm_up, scored=cut.pieces.scored)
    z = cut.comparison.residual(simulator.simulate({}, no_shifts(2), pieces), pieces)
    assert accurate and np.sqrt(np.mean(z**2)) < 1.05


@pytest.mark.parametrize(("effects", "word"), [({}, "no_gap"), ({"servo_gain": {"kp": 0.7}}, "causes")])
def test_chance_gains_no_more_where_desired_speeds_leave_no_lag(effects: Mapping[str, Any], word: str) -> None:
    """A calibration ended too early, as its probes were too long for such logs: any effect gained by going on."""
    rng = np.random.default_rng(2)
    held = Held.of(apply_all(nominal(arm()), build(effects)), 0.0005, PERIOD, accurate=True)
    episodes, paths = [], {name: path for name, path in motions().items() if name[:5] in ("trian", "chirp")}
    order = [*paths, next(iter(paths))]  # one is played twice
    for targets in map(paths.__getitem__, order):
        speed = np.gradient(targets, PERIOD, axis=0)
        path = held.play([np.hstack([targets, speed, 0.0 * speed])], [targets[0]], settle=1)[0]
        position, others = path + NOISE * rng.standard_normal(path.shape), np.vstack([speed, speed[-1:]])
        sensors = {f"velocity_command.{joint}": others[:, k] for k, joint in enumerate(arm().controlled)}
        episodes.append(Trajectory(PERIOD * np.arange(len(path)), targets, position, 0.0 * position, sensors=sensors))
    about = {"episodes": [{"policy": name} for name in order]}
    batch = Batch(tuple(episodes), arm().controlled, PERIOD, about)
    result = diagnose(batch, nominal(arm()), STEP, replace(FEW, nulls=2, seed=1), lambda phase: None)
    assert max(chance.gain for chance in result.chances) < 50.0
    assert (result.verdict.word, result.selection.chosen.names) == (word, tuple(effects))


SIM = BulletWorld("pendulum", {}, floating=False)
KP, KD = (float(values[0]) for values in (SIM.plant.servo.kp, SIM.plant.servo.kd))


def columns(kp: np.ndarray, kd: np.ndarray) -> list[Mapping[str, np.ndarray]]:
    return [{"kp_command.joint": np.append(kp, np.nan), "kd_command.joint": np.append(kd, np.nan)}]


@pytest.mark.parametrize("gains", [(2.0 * KP, 0.5 * KD), (0.0, KD)])
def test_the_servos_get_the_gains_of_the_log(gains: tuple[float, float]) -> None:
    logged = columns(*(np.full(9, gain) for gain in gains))
    sim = with_logged_gains(SIM, logged, "log")
    np.testing.assert_allclose([sim.plant.servo.kp[0], sim.plant.servo.kd[0]], gains)
    assert with_logged_gains(sim, logged, "log") is sim
    added = list_added_gains(SIM, sim)
    assert replace(SIM, effects=gains_of(added)).plant.servo.kp == sim.plant.servo.kp
    assert list_added_gains(SIM, SIM) == {} and gains_of({}) == {}
    diagnosed = replace(sim, effects=together([sim.effects, {"servo_gain": [{"kp": 0.7, "joints": "joint"}]}]))
    assert with_logged_gains(diagnosed, logged, "log") is diagnosed  # its fault is no gain that the log commands


def test_a_log_without_gains_or_with_those_of_the_simulator_changes_nothing() -> None:
    for logged in ([{}], columns(np.full(9, KP), np.full(9, KD))):
        assert with_logged_gains(SIM, logged, "log") is SIM


def test_gains_that_vary_are_sent_as_shares_of_the_robots_own_whatever_the_simulator_has() -> None:
    other = replace(SIM, effects={"servo_gain": {"kp": 0.5}})
    sensors = columns(KP * np.arange(9.0), np.full(9, 2.0 * KD))
    sim = with_logged_gains(other, sensors, "log")
    np.testing.assert_allclose([sim.plant.servo.kp[0], sim.plant.servo.kd[0]], [KP, KD])
    zero = np.zeros((10, 1))
    episode = Trajectory(np.arange(10.0), zero[:-1], zero, zero, sensors=sensors[0])
    shares = read_other_commands(episode, SIM.plant.robot, gains=True)[:, 2:]
    np.testing.assert_allclose(shares, np.stack([np.arange(9.0), np.full(9, 2.0)], axis=1))


def test_gains_below_zero_or_of_servos_without_any_are_refused_in_one_line() -> None:
    with pytest.raises(GslError, match=r"log: kp_command\.joint is 8, but kp of the simulator is 0"):
        free = replace(SIM, effects={"servo_gain": {"kp": 0.0}})
        with_logged_gains(free, columns(np.arange(9.0), np.full(9, KD)), "log")
    with pytest.raises(GslError, match=r"log: kd_command\.joint is -1; a gain is not below 0"):
        with_logged_gains(SIM, columns(np.full(9, KP), np.full(9, -1.0)), "log")


def test_a_log_of_torques_alone_is_replayed_with_servos_that_pull_to_no_position(tmp_path: Path) -> None:
    plant = apply_all(SIM.plant, build({"servo_gain": {"kp": 0.0}}))
    rng, held = np.random.default_rng(0), Held.of(plant, 0.0005, PERIOD, accurate=True)  # of second order
    for number in range(4):
        time = PERIOD * np.arange(201)
        torque = 0.2 * np.sin(np.outer(time, rng.uniform(2.0, 12.0, 3)) + rng.uniform(0.0, 6.0, 3)).sum(axis=1)
        sent = np.stack([0.0 * torque, 0.0 * torque, torque], axis=1)
        position = held.play([sent[:-1]], [np.zeros(1)], settle=1)[0][:, 0] + 1e-3 * rng.standard_normal(201)
        rows, names = np.column_stack([time, torque, position]), "t,tau,q"
        np.savetxt(tmp_path / f"log_{number}.csv", rows, delimiter=",", header=names, comments="")
    signals = {"torque_command": "tau", "position": "q"}
    chosen = {"joints": ["joint"], "robot": "pendulum", "time": {"column": "t"}, "signals": signals}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(chosen))
    done("import", "source=log_*.csv", "mapping=m.yaml", "name=log", folder=tmp_path)
    made = ("real=log", "sim=xl330_pendulum", "name=log", "workers=1")
    said = done("identify", *made, "evaluations=16", folder=tmp_path)
    assert "warning: This log never shows the gains of joint: kp is 0 in every row." in said.err
    world = yaml.safe_load((tmp_path / "runs/log/identify/world/identified.yaml").read_text())
    assert world["effects"]["servo_gain"][0] == {"kp": 0.0, "joints": "joint"}
    report = json.loads((tmp_path / "runs/log/identify/report.json").read_text())
    assert report["shrinkage"]["before"] < 1.5
