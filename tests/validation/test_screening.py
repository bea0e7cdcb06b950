"""Screening: winners that fall in the grounded simulator do not go to the robot, however many processes count."""

from __future__ import annotations

from dataclasses import replace

import pytest
from scenarios import QUIET
from scenarios import walk as plain_walk

from gsl.grounding.ane import ActionNoise
from gsl.grounding.effects import DiagnosedEffects
from gsl.grounding.gat import ActionTransformation
from gsl.grounding.none import NoGrounding
from gsl.grounding.preparation import without_margins
from gsl.grounding.servo import LearnedServo
from gsl.grounding.torque_noise import TorqueNoise
from gsl.policies.walk_engine import WalkEngine
from gsl.validation.screening import FIRST, Screened, foretells_falls, passing, screen

GIVEN = {"command_latency": {"delay": 0.02}}


def test_what_stands_walks_to_the_end_and_what_falls_at_once_walks_no_more() -> None:
    good = WalkEngine().initial
    names = WalkEngine().names
    bad = good.copy()
    bad[names.index("max_forward")] *= 6.0
    scenario = plain_walk(duration=2.0)
    screenings = [
        screen(scenario, {"good": good, "bad": bad}, 6, 1, workers=workers, console=QUIET) for workers in (1, 2)
    ]
    assert screenings[0] == screenings[1]
    assert screenings[0]["good"] == Screened(0, 6)
    assert screenings[0]["bad"].falls > 0 and screenings[0]["bad"].episodes == FIRST


def test_policies_that_never_fell_pass_or_those_that_fell_least() -> None:
    assert passing({"a": Screened(0, 30), "b": Screened(1, 30), "c": Screened(0, 30)}) == ["a", "c"]
    assert passing({"a": Screened(2, 4), "b": Screened(1, 30), "c": Screened(3, 30)}) == ["b"]
    assert passing({"a": Screened(1, 4), "b": Screened(2, 4), "c": Screened(1, 4)}) == ["a", "c"]


@pytest.mark.parametrize(
    ("grounding", "does"),
    [
        (NoGrounding(), False),
        (ActionNoise(), False),
        (TorqueNoise(), False),
        (ActionTransformation("f", "i"), False),
        (LearnedServo("s"), True),
        (DiagnosedEffects(effects=GIVEN), True),
        (DiagnosedEffects(effects=GIVEN, inner=LearnedServo("s")), True),
    ],
)
def test_only_a_simulator_that_yields_like_the_robot_foretells_falls(grounding: object, does: bool) -> None:
    assert foretells_falls(grounding) is does  # type: ignore[arg-type]


def test_margins_are_taken_off_and_what_was_learned_stays() -> None:
    servo = LearnedServo("s", torque_noise=1.0, noise=0.01, ensemble=True)
    assert without_margins(servo) == LearnedServo("s")
    effects = DiagnosedEffects(diagnosis="d", draws=True, inner=servo)
    assert without_margins(effects) == DiagnosedEffects(diagnosis="d", inner=LearnedServo("s"))
    shaken = DiagnosedEffects(effects=GIVEN, inner=TorqueNoise())
    assert without_margins(shaken) == replace(shaken, inner=NoGrounding())
    assert without_margins(ActionNoise()) == NoGrounding()
    noisy = ActionTransformation("f", "i", noise=0.005)
    assert without_margins(noisy) == replace(noisy, noise=0.0)
