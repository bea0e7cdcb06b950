"""The next experiment answers what a log leaves open, keeps the robot's limits, and can be played."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest
from swinging_arm import NOISE, PERIOD, QUICK, arm, logged
from swinging_arm import motions as whole

from gsl.core.body import Robot
from gsl.core.plant import nominal
from gsl.core.trajectory import Batch
from gsl.diagnosis.design.motions import Choice, motions, to_the_ends
from gsl.diagnosis.design.next_experiment import next_experiment
from gsl.diagnosis.design.questions import NOTHING, find_hidden, find_rivals
from gsl.diagnosis.design.rehearsal import Explanation, Rehearsal
from gsl.diagnosis.diagnose import diagnose
from gsl.diagnosis.simulate import calibration
from gsl.diagnosis.verdict.findings import Findings
from gsl.effects.effect import apply_all, build, names
from gsl.policies.limits import breach, limits
from gsl.robots.nao import nao
from gsl.worlds.held import Held

pytestmark = pytest.mark.slow

TIME = PERIOD * np.arange(150)
ROBOTS: dict[str, Callable[[], Robot]] = {"nao": nao, "swinging_arm.arm": arm}
LAGS = ("command_latency", "target_smoothing", "viscous_friction", "servo_gain", "coulomb_friction")


def swings(size: float, about: float, frequency: float) -> dict[str, np.ndarray]:
    """Three swings of both joints at one speed."""
    waves = {
        f"swing_{phase}": [np.sin(2 * np.pi * f * TIME + phase) for f in (frequency, 0.8 * frequency)]
        for phase in range(3)
    }
    return {
        name: about + size * np.array(wave).T * np.minimum(1.0, TIME / 0.3)[:, None] for name, wave in waves.items()
    }


def played(
    effects: Mapping[str, Any], commands: Mapping[str, np.ndarray], *, without: tuple[str, ...] = ()
) -> Findings:
    """The diagnosis of what the arm with effects logs; the first motion is played twice."""
    rng, robot = np.random.default_rng(3), arm()
    drawn = 0.5 * calibration.SPREADS[:, None] * rng.standard_normal((len(calibration.SPREADS), 2))
    drawn[calibration.COULOMB] = np.abs(drawn[calibration.COULOMB])
    held = Held.of(calibration.calibrate(apply_all(nominal(robot), build(effects)), drawn), 0.002, PERIOD)
    order = [*commands, next(iter(commands))]
    episodes = tuple(logged(held, commands[name], NOISE, rng) for name in order)
    batch = Batch(
        episodes, robot.controlled, PERIOD, {"episodes": [{"policy": name} for name in order], "world": {"step": 0.002}}
    )
    options = QUICK.__class__(**{**vars(QUICK), "without": without})
    return diagnose(batch, nominal(robot), 0.002, options, lambda phase: None)


def choices() -> tuple[Choice, ...]:
    return motions("swinging_arm.arm", arm(), PERIOD)


def but(*kept: str) -> tuple[str, ...]:
    """All effects but some."""
    return tuple(name for name in names() if name not in kept)


@pytest.mark.parametrize("robot", ROBOTS)
def test_everything_on_the_menu_keeps_the_limits_and_begins_and_ends_at_rest(robot: str) -> None:
    body = ROBOTS[robot]()
    bounds = limits(body)
    for choice in motions(robot, body, PERIOD):
        assert len({name for name, _ in choice.variants}) == len(choice.variants) == len(choice.episodes) - 1
        for name, targets in choice.variants:
            assert breach(bounds, targets, PERIOD) is None, name
            for row in (0, -1):
                np.testing.assert_allclose(targets[row], bounds.rest, atol=1e-12)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("back", [False, True])
def test_the_ends_of_every_room_are_reached_slowly_one_pair_at_a_time(robot: str, back: bool) -> None:
    body = ROBOTS[robot]()
    bounds = limits(body)
    way = to_the_ends(bounds, body, PERIOD, back=back) - bounds.rest
    np.testing.assert_allclose(way.max(axis=0), bounds.up, atol=1e-9)
    np.testing.assert_allclose(-way.min(axis=0), bounds.down, atol=1e-9)
    assert (np.abs(np.diff(way, axis=0)) <= bounds.speed * PERIOD + 1e-12).all()
    assert (way != 0.0).sum(axis=1).max() <= 2


UNTOLD = {
    "command_latency": {"delay": 0.012},
    "viscous_friction": {"coefficient": 0.3},
}


@cache
def diagnose_swings(truth: str) -> Findings:
    """The diagnosis of slow swings, which cannot tell what makes the arm late."""
    return played({truth: UNTOLD[truth]}, swings(0.25, 0.0, 0.25), without=but(*LAGS))


@pytest.mark.parametrize("truth", UNTOLD)
def test_playing_the_next_experiment_answers_the_question(truth: str) -> None:
    before = diagnose_swings(truth)
    assert before.verdict.word == "inseparable" and len(before.verdict.inseparable[0]) == 2
    wanted = next_experiment(before, choices())
    assert wanted is not None and {frozenset(pair) for pair in wanted.separates} == {
        frozenset(group) for group in before.verdict.inseparable
    }
    first, second, again = wanted.episodes
    assert first[0] == again[0] != second[0]
    after = played({truth: UNTOLD[truth]}, dict([second, first]), without=but(*LAGS))
    assert (after.verdict.word, after.selection.chosen.names) == ("causes", (truth,))


def test_nothing_speaks_against_the_truth_and_little_against_what_calibration_takes_up() -> None:
    findings = diagnose_swings("command_latency")
    rehearsal, question = Rehearsal.of(findings, choices()), find_rivals(findings)[0]
    itself = (question.truth,)
    assert (rehearsal.log_odds(question.truth, itself) == 0.0).all()
    rows = len(calibration.SPREADS)
    shift = 0.5 * calibration.SPREADS[:, None] * np.ones((rows, 2))
    moved = Explanation(question.truth.effects, question.truth.shifts + shift)
    odds, most = rehearsal.log_odds(moved, itself), 0.5 * 0.5**2 * rows * 2
    assert (odds > 0.0).all() and (odds < 1.2 * most).all()
    assert rehearsal.log_odds(question.truth, question.rivals).max() > 10 * most


def test_one_load_does_not_show_friction_that_depends_on_it() -> None:
    some = but("load_friction", "coulomb_friction", "torque_limit")
    pair = ("load_friction", "coulomb_friction")
    alone = played({}, swings(0.01, 0.3, 0.5), without=some)
    assert alone.verdict.word == "no_gap"
    assert pair in [pair.names for pair in find_hidden(alone)] and ("torque_limit", NOTHING) in [
        hidden.names for hidden in find_hidden(alone)
    ]
    wanted = next_experiment(alone, choices())
    assert wanted is not None and pair in wanted.separates
    assert pair not in [hidden.names for hidden in find_hidden(played({}, whole(), without=some))]


def test_a_log_that_shows_all_that_a_motion_can_leaves_nothing_to_play() -> None:
    findings = played({}, whole(), without=but("command_latency", "coulomb_friction", "load_friction", "encoder_noise"))
    assert findings.verdict.word == "no_gap" and next_experiment(findings, choices()) is None


def test_a_stop_that_nothing_hints_at_is_no_question() -> None:
    findings = played({}, swings(0.01, 0.3, 0.5), without=but("torque_limit", "joint_limit"))
    assert [hidden.names[0] for hidden in find_hidden(findings)] == ["torque_limit"]


def test_what_is_alike_in_the_air_by_nature_wants_feet_on_the_ground() -> None:
    findings = played({"zero_offset": {"offset": 0.03}}, whole(), without=but("zero_offset", "sensor_bias"))
    wanted = next_experiment(findings, choices())
    assert wanted is not None and wanted.separates == (("sensor_bias", "zero_offset"),)
    assert wanted.episodes == () and "ground" in wanted.excitation


def test_an_effect_that_makes_a_robot_run_away_would_have_been_seen() -> None:
    findings, shifts = played({}, swings(0.3, 0.0, 0.6), without=but("viscous_friction")), calibration.no_shifts(2)
    rehearsal = Rehearsal.again(findings)
    wild = Explanation({"viscous_friction": {"coefficient": 1e4}}, shifts)
    assert np.isposinf(rehearsal.log_odds(wild, (Explanation({}, shifts),))).all()
