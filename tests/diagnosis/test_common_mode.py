"""What joints share in their calibration is handed over to a cause, and a cause is split where groups differ."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gsl.core.body import lump
from gsl.core.plant import nominal
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.hypothesis.candidates import library
from gsl.diagnosis.hypothesis.common_mode import hand_over, shares
from gsl.diagnosis.hypothesis.problem import Problem
from gsl.diagnosis.log.log import cut_log
from gsl.diagnosis.options import Chance, Options
from gsl.diagnosis.search.plausibility import find_idle
from gsl.diagnosis.search.reference import Nominal
from gsl.diagnosis.search.screening import extend
from gsl.diagnosis.search.selection import Thresholds
from gsl.diagnosis.search.stepwise import Search
from gsl.diagnosis.simulate.calibration import COULOMB, KD, no_shifts
from gsl.effects.effect import apply_all, build
from gsl.robots.nao import nao
from gsl.worlds.held import Held

pytestmark = pytest.mark.slow

PERIOD = 0.02
NAO = lump(nao())
MASKS = {"all": np.ones(15, dtype=bool), "legs": np.arange(15) < 11, "arms": np.arange(15) >= 11}


def candidate(effect: str, *free: str):
    return next(entry for entry in library(NAO) if entry.effect == effect and entry.free == free)


def test_a_factor_that_all_joints_share_goes_to_the_gain_and_the_rest_stays() -> None:
    common = shares([candidate("servo_gain", "kp", "kd")], MASKS)
    shifts = no_shifts(15)
    shifts[KD] = np.log(1.25) + np.linspace(-0.1, 0.1, 15)
    bounds = np.array([[0.1, 0.1], [2.0, 2.0]])
    theta, left = hand_over(np.array([0.5, 0.4]), shifts, bounds, common)
    np.testing.assert_allclose(theta, [0.5, 0.5])
    np.testing.assert_allclose(left[KD], np.linspace(-0.1, 0.1, 15), atol=1e-12)


def test_no_more_is_handed_over_than_the_bounds_take() -> None:
    common = shares([candidate("coulomb_friction", "torque").on("arms")], MASKS)
    shifts = no_shifts(15)
    shifts[COULOMB] = 0.1
    theta, left = hand_over(np.array([0.2]), shifts, np.array([[0.0], [0.25]]), common)
    np.testing.assert_allclose(theta, [0.25])
    np.testing.assert_allclose(left[COULOMB], np.where(MASKS["arms"], 0.05, 0.1))


def problem_of(effects: dict[str, Any]) -> Problem:
    """Return the problem of a robot with some effects that swings all joints at four frequencies."""
    plant = nominal(NAO)
    time = PERIOD * np.arange(150)
    paths = [0.2 * np.sin(2 * np.pi * f * time)[:, None] * np.ones(len(NAO.motors)) for f in (0.4, 0.7, 1.0, 1.4)]
    paths = [path + np.array([NAO.stance.get(motor, 0.0) for motor in NAO.motors]) for path in paths]
    rng = np.random.default_rng(0)
    played = Held.of(apply_all(plant, build(effects)), 0.002, PERIOD).play(paths, [path[0] for path in paths], 25)
    logged = [path[:, :15] + 0.001 * rng.standard_normal((len(path), 15)) for path in played]
    episodes = tuple(
        Trajectory(PERIOD * np.arange(151), path[:, :15], measured, np.zeros_like(measured))
        for path, measured in zip(paths, logged, strict=True)
    )
    batch = Batch(
        episodes, NAO.controlled, PERIOD, {"episodes": [{"policy": str(k)} for k in range(4)], "world": {"step": 0.002}}
    )
    return Nominal(plant, 0.002).problem(cut_log(batch, NAO), Options(threads=1), lambda phase: None)


@pytest.fixture(scope="module")
def dry() -> Problem:
    """Return the problem of a robot whose legs have more dry friction than its arms."""
    return problem_of({"coulomb_friction": [{"torque": 0.2, "joints": "legs"}, {"torque": 0.1, "joints": "arms"}]})


@pytest.fixture(scope="module")
def knee() -> Problem:
    """Return the problem of a robot with a knee that is damped half as much."""
    return problem_of({"servo_gain": {"kd": 0.5, "joints": "LKneePitch"}}).only(("servo_gain",))


@pytest.mark.parametrize("offset, causes", [(0.006, 1), (0.001, 0)])
def test_zeros_of_many_joints_stand_by_their_calibration_whatever_chance_gains(offset: float, causes: int) -> None:
    """And whatever an interval says."""
    off = problem_of({"sensor_bias": {"bias": offset, "joints": "legs"}}).only(("sensor_bias", "zero_offset"))
    search = Search(off, off.fit_calibration(), Thresholds(share=0.5))  # as where joints shake
    chosen = search.select().chosen
    assert [candidate.scope for candidate in chosen.candidates] == ["legs"] * causes
    assert set(find_idle(chosen, 3.0, NAO)) == search.uphold(chosen) == {*["sensor_bias"] * causes}


def test_a_gain_of_one_joint_is_named_beside_a_friction_of_all_though_the_calibration_explains_it() -> None:
    effects = {"coulomb_friction": {"torque": 0.2}, "servo_gain": {"kp": 0.7, "joints": "LShoulderPitch"}}
    both = problem_of(effects).only(("coulomb_friction", "servo_gain"))
    chosen = Search(both, both.fit_calibration()).select().chosen
    assert chosen.places == {("coulomb_friction", "all"), ("servo_gain", "LShoulderPitch")}


def test_a_joint_in_which_the_calibration_undoes_a_cause_is_no_part_of_it() -> None:
    *soft, _ = NAO.list_joints("legs")
    legs = problem_of({"servo_gain": [{"kd": 0.5, "joints": joint} for joint in soft]}).only(("servo_gain",))
    ((cause, value),) = Search(legs, legs.fit_calibration()).select().chosen.pairs
    assert cause.joints(NAO) == soft and cause.scope == ", ".join(soft)
    assert cause.entry(value)["kd"] == pytest.approx(0.5, rel=0.05)


def test_what_frees_the_shifts_stands_whatever_chance_gains_on_residuals(knee: Problem) -> None:
    search = Search(knee, knee.fit_calibration(), Thresholds(gain=1e4))
    assert search.select().chosen.places == {("servo_gain", "LKneePitch")}


def test_where_joints_shake_what_frees_the_shifts_stands_as_anything_else(knee: Problem) -> None:
    chances = [Chance(1e4, 0.0, 1.0, 1.0)]
    search = Search(knee, knee.fit_calibration(), Thresholds.of(chances, knee.settings, 1e-9))
    assert not search.select().chosen.candidates


@pytest.mark.parametrize(("freed", "causes"), [(20.0, 1), (1e4, 0)])
def test_what_chance_frees_of_the_shifts_stands_for_nothing(freed: float, causes: int, knee: Problem) -> None:
    thresholds = Thresholds.of([Chance(1e4, freed, 1.0, 1.0), Chance(5e3, 0.0, 1.0, 1.0)], knee.settings, 0.0)
    chosen = Search(knee, knee.fit_calibration(), thresholds).select().chosen
    assert len(chosen.candidates) == causes


def test_calibration_alone_is_fitted_again_from_where_a_larger_hypothesis_ends(dry: Problem) -> None:
    none = dry.fit_calibration()
    astray = no_shifts(15)
    astray[COULOMB], astray[KD] = -1.0, 1.5
    stuck = dry.fit((), np.zeros(0), astray, every=1, rounds=1)
    larger, _ = extend(dry.only(("coulomb_friction",)), none, 1)
    assert stuck.fit.cost > 1.1 * none.fit.cost
    assert dry.relax(stuck, larger).fit.cost == pytest.approx(none.fit.cost, rel=0.02)
    assert dry.relax(none, [stuck]) is none


def test_no_lead_is_followed_twice() -> None:
    """A suspect joint is replayed alone, and read out of the replay of all joints besides."""
    knee = problem_of({"coulomb_friction": {"torque": 0.3, "joints": "LKneePitch"}}).only(("coulomb_friction",))
    fits, screening = extend(knee, knee.fit_calibration(), 8)
    assert [fit.candidates[0].scope for fit in fits] == ["LKneePitch", "legs"]
    assert [lead.candidate.scope for lead in screening.leads].count("LKneePitch") == 2


def test_friction_that_differs_between_legs_and_arms_is_told_apart(dry: Problem) -> None:
    friction = candidate("coulomb_friction", "torque")
    everywhere = dry.fit((friction,), np.array([0.15]), no_shifts(15), every=1)
    apart = Search(dry, dry.fit_calibration()).split(everywhere)
    torques = {part.scope: float(value[0]) for part, value in zip(apart.candidates, apart.parameters, strict=True)}
    assert torques == pytest.approx({"legs": 0.2, "arms": 0.1}, rel=0.1)


def test_a_search_without_an_effect_finds_what_it_would_find_anew(dry: Problem) -> None:
    some = dry.only(("coulomb_friction", "viscous_friction", "load_friction"))
    none = some.fit_calibration()
    first, _ = extend(some, none, 3)
    again = some.without(("load_friction",))
    fits, screening = extend(again, none, 3)
    assert "load_friction" not in {lead.candidate.effect for lead in screening.leads}
    anew, _ = extend(replace(again, train=again.train), none, 3)
    assert [fit.cost for fit in fits] == [fit.cost for fit in anew]
    assert any(fit is other for other in first for fit in fits)
    assert not any(fit is other for other in anew for fit in fits)
    assert again.fit_calibration() is none
