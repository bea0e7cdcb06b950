"""What a selection allows to say: how sure each cause is, what comes back without it, why others were passed over."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from swinging_arm import arm, log
from test_plausibility import claim

from gsl.core.plant import nominal
from gsl.diagnosis.hypothesis.hypothesis import Gain, Hypothesis, gain
from gsl.diagnosis.log.log import cut_log
from gsl.diagnosis.options import Options
from gsl.diagnosis.search.reference import Nominal
from gsl.diagnosis.search.selection import Selection
from gsl.diagnosis.search.stepwise import Search
from gsl.diagnosis.settings import SearchSettings, VerdictSettings
from gsl.diagnosis.simulate import calibration
from gsl.diagnosis.verdict.self_test import Trial, measure_mistakes
from gsl.diagnosis.verdict.verdict import Judge

PER_SAMPLE = np.full(8, 100.0)
EMPTY = claim("coulomb_friction", [0.1], ("torque",))
NONE = replace(EMPTY, candidates=(), parameters=(), costs=np.full(8, 1100.0), counts=PER_SAMPLE)


def friction(joints: str, cost: float) -> Hypothesis:
    everywhere = claim("coulomb_friction", [0.1], ("torque",))
    return replace(
        everywhere, candidates=(everywhere.candidates[0].on(joints),), costs=np.full(8, cost), counts=PER_SAMPLE
    )


def with_both(first: Hypothesis, other: Hypothesis, cost: float) -> Hypothesis:
    parts = {"candidates": first.candidates + other.candidates, "parameters": first.parameters + other.parameters}
    return replace(first, costs=np.full(8, cost), **cast(Any, parts))


def selection(chosen: Hypothesis, *others: Hypothesis) -> Selection:
    return Selection(
        NONE, chosen, tuple(sorted([NONE, chosen, *others], key=lambda hypothesis: hypothesis.cost)), cast(Any, None)
    )


def test_two_causes_of_one_effect_are_each_judged_against_the_other_alone() -> None:
    shoulder, elbow = friction("shoulder", 300.0), friction("elbow", 900.0)
    verdict = Judge(1.0).judge(selection(with_both(shoulder, elbow, 100.0), shoulder, elbow, friction("all", 200.0)))
    first, second = verdict.causes
    assert first.value == pytest.approx(800 / 1004)  # elbow alone leaves 900 of 1100, of which 96 are noise
    assert second.value == pytest.approx(200 / 1004)
    assert verdict.word == "causes"


def test_a_cause_in_whose_place_no_other_was_tried_is_not_certain() -> None:
    shoulder, elbow = friction("shoulder", 300.0), friction("elbow", 900.0)
    alone = Judge(1.0).judge(selection(with_both(shoulder, elbow, 100.0), shoulder, elbow))
    assert [cause.rival for cause in alone.causes] == [None, None]
    assert max(cause.probability for cause in alone.causes) <= VerdictSettings.unrivalled
    load = replace(claim("load_friction", [0.2], ("coefficient",)), costs=np.full(8, 900.0), counts=PER_SAMPLE)
    rivals = with_both(shoulder, load, 200.0), with_both(elbow, load, 200.0)
    tried = Judge(1.0).judge(selection(with_both(shoulder, elbow, 100.0), shoulder, elbow, *rivals))
    assert [cause.rival for cause in tried.causes] == ["load_friction", "load_friction"]
    assert min(cause.probability for cause in tried.causes) > VerdictSettings.unrivalled


def test_one_held_out_sample_says_nothing_of_how_much_a_gain_varies() -> None:
    first, other = (replace(friction("elbow", cost), costs=np.array([cost])) for cost in (100.0, 300.0))
    assert gain(first, other) == Gain(200.0, -np.inf, np.inf)


@pytest.mark.parametrize(("left", "word"), [(1.0, "unknown"), (3.0, "no_gap")])
def test_what_a_calibration_leaves_of_logs_without_a_gap_is_no_gap(left: float, word: str) -> None:
    """Of few motions a calibration leaves more than noise: simulated logs say how much."""
    off = replace(NONE, costs=2.5 * NONE.counts)
    tried = replace(selection(off), none=off)
    assert Judge(left, left).judge(tried).word == word


@pytest.mark.parametrize(("cost", "rival"), [(1000.0, "load_friction"), (1200.0, None)])
def test_what_costs_more_than_a_calibration_is_no_rival(cost: float, rival: str | None) -> None:
    """Its own simulated logs are of other robots, and may differ from the real one by any amount."""
    load = replace(claim("load_friction", [0.2], ("coefficient",)), costs=np.full(8, cost), counts=PER_SAMPLE)
    judge = Judge(1.0, margins={"load_friction": 1e6})
    (cause,) = judge.judge(selection(friction("shoulder", 100.0), load)).causes
    assert cause.rival == rival
    assert (cause.probability > 0.9) == (rival is None)


def test_a_rival_whose_own_logs_get_the_same_answer_is_not_told_apart() -> None:
    joint = friction("shoulder", 100.0)
    load = replace(claim("load_friction", [0.2], ("coefficient",)), costs=np.full(8, 150.0), counts=PER_SAMPLE)
    logs = {  # costs of both, in logs of the truth
        joint.names: [(90.0, 500.0), (100.0, 460.0)],
        load.names: [(100.0, 400.0), (100.0, 390.0)],
    }

    def mistakes(costs: dict[tuple[str, ...], list[tuple[float, float]]]) -> dict[str, float]:
        rest = 1.0, np.ones(2), np.zeros(1)
        trials = [Trial(truth, (), pair, *rest) for truth, pairs in costs.items() for pair in pairs]
        return measure_mistakes((joint, load), trials)

    assert mistakes(logs) == {"load_friction": 1.0}  # ahead by 290 and more, where the real log has it ahead by 400
    assert mistakes({**logs, load.names: [(100.0, 400.0), (400.0, 90.0)]}) == {"load_friction": 0.5}
    assert mistakes({**logs, load.names: [(100.0, 150.0), (400.0, 90.0)]}) == {"load_friction": 0.0}
    assert mistakes({joint.names: logs[joint.names]}) == {}
    tried = selection(joint, load)
    assert Judge(1.0).judge(tried).word == "causes"
    assert Judge(1.0, mistakes={"load_friction": 0.0}).judge(tried) == Judge(1.0).judge(tried)
    for share, probability in ((0.5, 0.745), (1.0, 0.5)):
        verdict = Judge(1.0, mistakes={"load_friction": share}).judge(tried)
        assert verdict.word == "inseparable" and verdict.inseparable == (("coulomb_friction", "load_friction"),)
        assert verdict.causes[0].probability == pytest.approx(probability, abs=0.01)


@pytest.mark.parametrize(("odd", "word"), [(0.7, "causes"), (1.3, "unknown")])
def test_a_joint_that_shakes_as_its_causes_do_not_make_it_speaks_against_them(odd: float, word: str) -> None:
    """Whatever share of the gap they explain."""
    verdict = Judge(1.0, odd={"elbow": 0.2, "shoulder": odd}).judge(selection(friction("shoulder", 100.0)))
    assert verdict.word == word and verdict.explained == 1.0
    assert verdict.odd == (("shoulder",) if odd > 1.0 else ())


@pytest.mark.parametrize(
    ("cost", "guessed", "word"), [(60.0, True, "unknown"), (60.0, False, "causes"), (90.0, True, "causes")]
)
def test_within_a_guessed_noise_nothing_is_named(cost: float, guessed: bool, word: str) -> None:
    """A log of joints that shake and of no repeats: its roughness is no noise floor."""
    none = replace(NONE, costs=np.full(8, cost))
    better = replace(selection(friction("all", 0.3 * cost)), none=none)
    verdict = Judge(1.0, guessed=guessed).judge(better)
    assert (verdict.word, verdict.hollow) == (word, word == "unknown")
    unusual = replace(better, none=replace(none, fit=replace(none.fit, prior_cost=150.0)), least=20.0)
    assert not Judge(1.0, guessed=guessed).judge(unusual).hollow  # what a calibration would have to be far off for


@pytest.mark.parametrize(
    ("cost", "guessed", "word"), [(7.0, False, "causes"), (7.0, True, "unknown"), (100.0, False, "unknown")]
)
def test_below_a_measured_noise_a_law_has_nothing_to_explain(cost: float, guessed: bool, word: str) -> None:
    """A log of a simulation without noise: what its time steps leave is far below the floor, and a law halves it."""
    chosen = replace(friction("all", cost), levels=np.full(3, cost / 100.0))
    assert Judge(1.0, guessed=guessed).judge(selection(chosen), missing=2.0).word == word


def test_a_spurious_effect_that_is_cheapest_and_fails_hides_no_other() -> None:
    """It gains much in one sample of eight and nothing elsewhere, the right one in every sample."""
    right, none = friction("all", 100.0), replace(NONE, costs=np.array([8000.0] + 7 * [114.0]))
    spurious = replace(claim("torque_limit", [1.12], ("factor",)), counts=PER_SAMPLE)
    spurious = replace(spurious, costs=np.array([0.0] + 7 * [114.0]))
    assert spurious.cost < right.cost < none.cost
    search = Search(cast(Any, SimpleNamespace(settings=SearchSettings())), none)
    assert search.part_singles([spurious, right], 20.0) == ([spurious], [right])
    assert search.part_singles([spurious], 20.0) == ([], [])
    tried = replace(selection(right, spurious), none=none)
    assert Judge(1.0).judge(tried).word == "inseparable"
    verdict = Judge(1.0).judge(replace(tried, rejected=(spurious,)))
    assert (verdict.word, verdict.causes[0].rival) == ("causes", None)
    assert replace(tried, rejected=(spurious,)).objection(spurious) == "not significantly better than a calibration"


@pytest.mark.parametrize(("share", "stands"), [(0.99, True), (1.01, False)])
def test_zeros_that_are_off_to_one_side_stand_only_where_they_cost_less(share: float, stands: bool) -> None:
    shifts = calibration.no_shifts(4)
    shifts[calibration.ZERO] = 0.02
    none = replace(NONE, fit=replace(NONE.fit, shifts=shifts, prior_cost=0.0))
    zero = replace(claim("zero_offset", [0.02], ("offset",)), fit=none.fit, costs=share * none.costs)
    scopes = {scope: np.ones(4, dtype=bool) for _, scope in zero.places}
    problem = SimpleNamespace(settings=SearchSettings(), scopes=scopes, simulator=SimpleNamespace(spread=1.0))
    parted = Search(cast(Any, problem), none).part_singles([zero], 1e9)
    assert parted == (([], [zero]) if stands else ([], []))


@pytest.mark.parametrize(
    ("levels", "is_nothing"), [((0.5, 0.6), True), ((0.5, 1.3), False), ((1.0, 1.0), False), ((0.96, 0.96), True)]
)
def test_where_a_calibration_leaves_no_more_than_noise_there_is_nothing_to_explain(
    levels: tuple[float, float], is_nothing: bool
) -> None:
    problem = Nominal(nominal(arm()), 0.002).problem(cut_log(log({}), arm()), Options(threads=1), lambda _: None)
    costs, counts = np.full(8, 100.0 * np.mean(levels)), np.full(8, 100.0)
    none = replace(NONE, costs=costs, counts=counts, levels=np.array(levels))
    assert Search(problem, none).nothing_left() == is_nothing
    shifts = calibration.no_shifts(2)
    shifts[calibration.KP] = 3.0 * calibration.SPREADS[calibration.KP] * np.sqrt(len(shifts) / 2.0)
    hiding = replace(none, fit=replace(none.fit, shifts=shifts, prior_cost=calibration.prior_cost(shifts)))
    assert not Search(problem, hiding).nothing_left()


@pytest.mark.parametrize(
    ("costs", "torque", "why"),
    [
        (np.full(8, 110.0), 0.1, None),
        (np.full(8, 90.0), 0.1, "little gain for another effect"),
        (np.array([0.0] * 4 + [150.0] * 4), 0.1, "not significantly better"),
        (np.full(8, 50.0), 50.0, "a value beyond its documented range"),
    ],
)
def test_what_costs_less_and_is_not_chosen_has_a_reason(costs: np.ndarray, torque: float, why: str | None) -> None:
    chosen = friction("shoulder", 100.0)
    more = with_both(chosen, friction("elbow", 900.0), 0.0)
    more = replace(more, costs=costs, parameters=(*chosen.parameters, np.array([torque])))
    assert selection(chosen).objection(more) == why
    assert selection(chosen).objection(friction("shoulder", 90.0)) is None  # the same, fitted otherwise
