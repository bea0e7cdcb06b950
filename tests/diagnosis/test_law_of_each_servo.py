"""A law of each servo: what it explains beyond effects, which form that has, and that it explains no noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from swinging_arm import FEW, PERIOD, arm, found, log
from test_verdict import NONE, friction, selection

from gsl.core.plant import nominal
from gsl.diagnosis.diagnose import prepare
from gsl.diagnosis.log.log import Log
from gsl.diagnosis.options import Options
from gsl.diagnosis.settings import LawSettings
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.simulate.in_the_air import InTheAir
from gsl.diagnosis.simulate.simulator import Bench
from gsl.diagnosis.verdict.document import document
from gsl.diagnosis.verdict.servo_law import find_forms, learn_laws
from gsl.diagnosis.verdict.servo_terms import find_answers, find_scales, make_terms, pass_play, replay
from gsl.diagnosis.verdict.shrinkage import ceiling
from gsl.diagnosis.verdict.verdict import Judge
from gsl.worlds.servo_state import COMMANDS

SMOOTHED = {"target_smoothing": {"time_constant": 0.03}}
HOW = LawSettings()


def arm_log(**effects: Mapping[str, Any]) -> Log:
    return prepare(log(effects), arm(), Options(threads=1))


def simulator() -> InTheAir:
    return InTheAir(nominal(arm()), 0.002, PERIOD)


# --- what it says of a diagnosis


@pytest.mark.slow
def test_a_filter_that_the_library_lacks_is_unknown_and_its_form_is_said() -> None:
    """A latency comes near a filter on the target, but a servo can do better."""
    findings = found(SMOOTHED, without=(*FEW.without, "target_smoothing"))
    assert findings.verdict.word == "unknown" and findings.verdict.missing > 1.0
    assert {form.joint for form in findings.forms} == {"shoulder", "elbow"}
    assert all(0.005 < form.late < 0.03 for form in findings.forms)
    report = document(findings)
    assert [form["joint"] for form in report["forms"]] == [form.joint for form in findings.forms]
    assert report["causes"] == []
    assert report["shrinkage"]["fraction"] < report["shrinkage"]["ceiling_fraction"] <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize("effects", [{}, SMOOTHED, {"command_latency": {"delay": 0.012}}])
def test_on_top_of_the_truth_no_law_explains_more(effects: dict[str, dict[str, float]]) -> None:
    findings = found(effects, without=FEW.without)
    assert findings.laws is not None and findings.laws.missing < 0.7
    assert findings.forms == () and findings.verdict.word == ("causes" if effects else "no_gap")


@pytest.mark.parametrize(("missing", "word"), [(0.0, "causes"), (0.5, "causes"), (1.5, "unknown"), (1e6, "unknown")])
def test_causes_that_explain_surely_less_than_a_servo_could_are_not_named(missing: float, word: str) -> None:
    """Nothing else speaks against them: they explain 99 % of the excess and leave what noise costs."""
    right = selection(friction("all", 100.0), friction("elbow", 900.0))
    assert Judge(1.0).judge(right, missing).word == word
    assert Judge(1.0).judge(right, missing).missing == missing


def test_a_calibration_that_explains_surely_less_than_a_servo_could_is_a_gap() -> None:
    quiet = replace(NONE, costs=np.full(8, 96.0), levels=np.full(2, 0.96))
    assert Judge(1.0).judge(replace(selection(quiet), none=quiet), 0.9).word == "no_gap"
    assert Judge(1.0).judge(replace(selection(quiet), none=quiet), 1.1).word == "unknown"


def test_of_fewer_windows_than_folds_no_law_is_learned() -> None:
    whole = arm_log()
    few = replace(whole, train=whole.train[:1])
    assert learn_laws(few, simulator(), {}, no_shifts(2)) is None


# --- what it is made of


def test_an_answer_is_what_a_replay_of_other_commands_moves() -> None:
    """A target that is a tenth of the last one moves the arm as one lag's term says, where torque is not limited."""
    batch, bench_of = arm_log(), simulator()
    bench = Bench(bench_of, batch.pieces, batch.comparison)
    replays = replay(bench, {}, no_shifts(2), HOW.lags)
    assert replays is not None
    commands = batch.pieces.windows.commands
    older = np.concatenate([commands[:, 1:], commands[:, -1:]], axis=1)
    windows = batch.pieces.windows._replace(commands=np.ascontiguousarray(0.9 * commands + 0.1 * older))
    moved = bench.comparison.residual(
        bench_of.simulate({}, no_shifts(2), replace(batch.pieces, windows=windows)), batch.pieces
    )
    for k in range(2):
        forms, terms = make_terms(replays, k, find_scales(replays, k), HOW)
        answer = 0.1 * find_answers(replays, k, terms)[int(np.argmax(forms == "lag"))]
        true = moved[..., k] - replays.z[..., k]
        calm = (40.0 * np.abs(replays.targets[0] - replays.position) < 6.0).all(axis=(1, 2))
        assert calm.sum() > 5
        assert np.sqrt(np.mean((answer - true)[calm] ** 2)) < 0.15 * np.sqrt(np.mean(true[calm] ** 2))


def test_a_log_that_is_late_moves_by_its_speed() -> None:
    batch, late = arm_log(), 1e-3
    bench = Bench(simulator(), batch.pieces, batch.comparison)
    replays = replay(bench, {}, no_shifts(2), HOW.lags)
    delayed = replay(bench, {"sensor_delay": {"delay": late}}, no_shifts(2), HOW.lags)
    assert replays is not None and delayed is not None
    answer = late * find_answers(replays, 0, np.zeros((0, *replays.clock.shape)))[-1]
    moves = np.abs(answer) > 0.5  # slowly enough for the servo, which sees the delay as well, to do little about it
    slope = np.sum((delayed.z - replays.z)[..., 0][moves] * answer[moves]) / np.sum(answer[moves] ** 2)
    assert 0.3 < slope < 1.7


def test_a_play_follows_half_its_width_behind() -> None:
    position = np.array([[0.0, 0.01, 0.02, 0.01, 0.0, -0.01]])
    assert pass_play(position, 0.01) == pytest.approx(np.array([[0.0, 0.005, 0.015, 0.015, 0.005, -0.005]]))
    assert pass_play(position, 0.0) == pytest.approx(position)


@pytest.mark.parametrize("delay", [0.012, 0.03])
def test_a_latency_is_a_lag_of_its_size(delay: float) -> None:
    forms = find_forms(arm_log(command_latency={"delay": delay}), simulator())
    assert {form.joint for form in forms} <= {"shoulder", "elbow"} and {form.form for form in forms} == {"lag"}
    assert [form.late for form in forms] == pytest.approx([delay] * len(forms), rel=0.15)
    assert all(form.shares["lag"] > 0.85 and not form.x for form in forms)


def test_dry_friction_of_a_joint_brakes_either_way_with_its_torque() -> None:
    """In steps a joint is braked from where it turned round on, which is a form as good as that of speed."""
    (form,) = find_forms(arm_log(coulomb_friction={"torque": 0.3, "joints": "elbow"}), simulator())
    assert (form.joint, form.form) == ("elbow", "reversal")
    assert [form.y[0], form.y[-1]] == pytest.approx([0.3, -0.3], rel=0.2)
    assert list(form.x) == sorted(form.x)


def test_where_all_joints_shake_or_replays_diverge_there_is_no_law() -> None:
    batch, still = arm_log(), no_shifts(2)
    assert learn_laws(batch, simulator(), {}, still) is not None
    shaking = replace(batch.comparison, shaking=np.array([True, True]))
    assert learn_laws(replace(batch, comparison=shaking), simulator(), {}, still) is None
    nowhere = batch.pieces.windows._replace(motion=np.full_like(batch.pieces.windows.motion, np.nan))
    lost = replace(batch, pieces=replace(batch.pieces, windows=nowhere))
    assert learn_laws(lost, simulator(), {}, still) is None
    assert find_forms(replace(batch, comparison=shaking), simulator()) == ()


def test_a_joint_that_shakes_has_no_law_and_the_others_have_theirs() -> None:
    batch, still = arm_log(coulomb_friction={"torque": 0.3, "joints": "elbow"}), no_shifts(2)
    first = replace(batch, comparison=replace(batch.comparison, shaking=np.array([True, False])))
    laws = learn_laws(first, simulator(), {}, still)
    assert laws is not None
    assert laws.by_joint[0, 0] == 0.0 < laws.by_joint[1, 1]
    assert [form.joint for form in find_forms(first, simulator())] == ["elbow"]
    assert ceiling(first, simulator().simulate({}, still, first.pieces), laws) is None


def test_the_ceiling_is_what_laws_leave_of_the_excess() -> None:
    batch, still = arm_log(**SMOOTHED), no_shifts(2)
    laws = learn_laws(batch, simulator(), {}, still)
    before = simulator().simulate({}, still, batch.pieces)
    assert laws is not None
    share = ceiling(batch, before, laws)
    assert share is not None and 0.9 < share <= 1.0
    as_before = replace(laws, z=batch.residual(before)[laws.windows])
    assert ceiling(batch, before, as_before) == pytest.approx(0.0)
    assert ceiling(batch, before, replace(laws, z=0.0 * laws.z)) == 1.0
    assert ceiling(batch, before, None) is None
    same = replace(batch, pieces=replace(batch.pieces, real=before))
    assert ceiling(same, before, laws) is None


def test_older_targets_reach_back_as_far_as_a_replay_remembers() -> None:
    assert HOW.lags < COMMANDS


@pytest.mark.parametrize(("joints", "word"), [((0.3, 0.3), "no_gap"), ((0.3, 0.9), "unknown")])
def test_where_nothing_is_left_a_law_explains_nothing(joints: tuple[float, float], word: str) -> None:
    """As with a tolerance that is wider than what a calibration leaves."""
    calm = replace(NONE, costs=np.full(8, 100.0 * np.mean(joints)), levels=np.array(joints))
    assert Judge(1.0).judge(replace(selection(calm), none=calm), 5.0).word == word
