"""Claims that a log's further channels, or an effect's documented range, refute."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from swinging_arm import FEW, PERIOD, arm, found, log

from gsl.core.plant import nominal
from gsl.core.trajectory import Batch
from gsl.diagnosis.hypothesis.candidates import library
from gsl.diagnosis.hypothesis.fit import Fit
from gsl.diagnosis.hypothesis.hypothesis import Hypothesis
from gsl.diagnosis.log.log import cut_log
from gsl.diagnosis.search.plausibility import find_idle, refute
from gsl.diagnosis.search.selection import stands
from gsl.diagnosis.search.stepwise import Search
from gsl.diagnosis.settings import SearchSettings
from gsl.diagnosis.simulate.calibration import no_shifts
from gsl.diagnosis.verdict.document import document

pytestmark = pytest.mark.slow


def with_channels(batch: Batch, channels: Mapping[str, Any]) -> Batch:
    """The log with further columns, each from an episode's ticks of positions [rad] and targets [rad]."""
    episodes = []
    for episode in batch.episodes:
        target = np.vstack([episode.action, episode.action[-1:]])
        columns = {name: np.asarray(make(target, episode.position), dtype=float) for name, make in channels.items()}
        episodes.append(replace(episode, sensors=columns))
    return replace(batch, episodes=tuple(episodes))


def claim(effect: str, values: list[float], free: tuple[str, ...]) -> Hypothesis:
    """A hypothesis with fitted values, its fit left out."""
    candidate = next(entry for entry in library(arm()) if entry.effect == effect and entry.free == free)
    fit = Fit(np.array(values), no_shifts(2), 0.0, 0.0, np.eye(len(values)))
    return Hypothesis((candidate,), (np.array(values),), fit, np.zeros(1), np.ones(1), np.ones(2))


def steady(voltage: float) -> Any:
    return lambda target, position: np.full(len(position), voltage)


def test_a_voltage_that_does_not_sag_refutes_a_sagging_supply() -> None:
    said = claim("supply_sag", [1.0], ("resistance",))
    for voltage, is_wrong in ((steady(21.6), True), (lambda t, q: 21.6 - 8.0 * np.abs(t - q).sum(axis=1), False)):
        exp = cut_log(with_channels(log({}), {"voltage": voltage}), arm())
        assert ("supply_sag" in refute(said, exp, nominal(arm()))) == is_wrong
    assert not refute(said, cut_log(log({}), arm()), nominal(arm()))


def test_a_motor_that_stays_cold_refutes_a_gain_that_fades_with_warmth() -> None:
    said = claim("gain_fade", [0.01], ("rate",))
    warm = lambda t, q: 30.0 + PERIOD * np.arange(len(q))  # noqa: E731
    for temperature, is_wrong in ((steady(30.0), True), (warm, False)):
        channels = {"temperature.shoulder": temperature, "temperature.elbow": temperature}
        exp = cut_log(with_channels(log({}), channels), arm())
        assert ("gain_fade" in refute(said, exp, nominal(arm()))) == is_wrong


@pytest.mark.parametrize("factor", [1.0, 0.5])
def test_a_logged_torque_refutes_a_gain_that_it_does_not_have(factor: float) -> None:
    servo = nominal(arm()).servo

    def told(target: np.ndarray, position: np.ndarray, k: int) -> np.ndarray:
        speed = np.gradient(position[:, k], PERIOD)
        wanted = factor * servo.kp[k] * (target - position)[:, k] - servo.kd[k] * speed
        return np.asarray(np.clip(wanted, -servo.limit[k], servo.limit[k]))

    torque = {f"torque.{name}": lambda t, q, k=k: told(t, q, k) for k, name in enumerate(("shoulder", "elbow"))}
    exp = cut_log(with_channels(log({"servo_gain": {"kp": factor}}), torque), arm())
    assert ("servo_gain" in refute(claim("servo_gain", [0.5], ("kp",)), exp, nominal(arm()))) == (factor == 1.0)


@pytest.mark.parametrize(("alone", "is_enough"), [(0.2, True), (0.5, False)])
def test_a_smaller_set_beyond_its_documented_range_is_no_simpler_explanation(alone: float, is_enough: bool) -> None:
    """Friction far beyond what servos have does another cause's work: that one need not be surely better."""
    few, costs = claim("stribeck_friction", [alone, 0.1], ("torque", "velocity")), np.array([100.0, 210.0])
    few = replace(few, costs=costs, counts=np.ones(2))
    load = claim("load_friction", [0.2], ("coefficient",))
    both = replace(few, candidates=few.candidates + load.candidates, costs=np.array([110.0, 120.0]))
    both = replace(both, parameters=(np.array([0.2, 0.1]), np.array([0.2])))
    assert few.claims_its_names == is_enough
    assert both.claims_its_names
    assert stands(both, few, 20.0, 25.0) != is_enough
    assert not stands(both, few, 20.0, 75.0)  # a gain of 80 of which a flaw of the simulator has as much


def test_a_value_beyond_the_documented_range_is_no_cause() -> None:
    result = found({"command_latency": {"delay": 0.085}}, without=FEW.without)
    assert "command_latency" in result.refuted
    assert "command_latency" not in result.selection.chosen.names
    assert any("command_latency would explain much" in caveat for caveat in document(result)["caveats"])


@pytest.mark.parametrize(
    ("effect", "values", "free", "sd", "idle"),
    [
        ("torque_limit", [1.12], ("factor",), 0.1, True),
        ("torque_limit", [1.12], ("factor",), 0.02, False),
        ("servo_gain", [0.9, 0.5], ("kp", "kd"), 0.1, False),  # one of two strengths is enough
        ("stribeck_friction", [0.05, 0.1], ("torque", "velocity"), 0.1, True),  # a velocity is no strength
    ],
)
def test_a_cause_whose_interval_holds_what_does_nothing_is_none(
    effect: str, values: list[float], free: tuple[str, ...], sd: float, idle: bool
) -> None:
    cause = claim(effect, values, free)
    cause = replace(cause, fit=replace(cause.fit, covariance=np.diag(np.full(len(values), sd**2))))
    assert (effect in find_idle(cause, 1.0, arm())) == idle
    assert all(reason.endswith("which does nothing") for reason in find_idle(cause, 1.0, arm()).values())


def test_an_interval_holds_what_the_self_test_was_off_by_and_stays_off_doing_nothing() -> None:
    late = claim("command_latency", [0.01], ("delay",))
    late = replace(late, fit=replace(late.fit, covariance=np.diag([1e-4**2])))
    (narrow,) = late.intervals(2.0)
    assert narrow[:, 0] == pytest.approx([0.01 - 1.96 * 2e-4, 0.01 + 1.96 * 2e-4])
    (wide,) = late.intervals(2.0, np.array([1e-3]))
    assert wide[:, 0] == pytest.approx([0.01 - 1.96 * np.hypot(2e-4, 1e-3), 0.01 + 1.96 * np.hypot(2e-4, 1e-3)])
    (open_below,) = late.intervals(2.0, np.array([0.02]))
    assert open_below[0, 0] == pytest.approx(narrow[0, 0]) and open_below[1, 0] > 0.04


def test_what_is_dropped_leaves_the_others_within_their_ranges() -> None:
    """A smaller set beyond its ranges is a little cheaper; the one within them shows that an effect is superfluous."""
    parts = (
        claim("stribeck_friction", [0.2, 0.1], ("torque", "velocity")),
        claim("load_friction", [0.2], ("coefficient",)),
    )
    stiction, load = (replace(part, costs=np.full(8, 30.0), counts=np.ones(8)) for part in parts)
    beyond = replace(stiction, parameters=(np.array([0.5, 0.1]),), costs=np.full(8, 29.0))
    both = replace(
        load, candidates=stiction.candidates + load.candidates, parameters=stiction.parameters + load.parameters
    )
    nothing = replace(both, candidates=(), parameters=(), costs=np.full(8, 500.0))
    fits = {load.candidates[0].effect: load, beyond.candidates[0].effect: beyond}
    problem = SimpleNamespace(
        settings=SearchSettings(), fit_all=lambda asks: [fits[ask.candidates[0].effect] for ask in asks]
    )
    assert Search(cast(Any, problem), nothing).prune(both) is load
