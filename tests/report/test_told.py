"""What is said of measured policies: which is returned, what it is worth beside π0, and why the iterations ended."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from gsl.core.unit import Unit
from gsl.report.account import describe_choice
from gsl.report.evaluation_cells import cells
from gsl.report.headline import headline
from gsl.report.iteration import Rounds
from gsl.rollout.parallel import Episode
from gsl.rollout.returns import gain, summary
from gsl.storage.artifact import Artifact
from gsl.tasks.own_reward import OwnReward
from gsl.tasks.walk import Walk


def measured(value: float) -> dict[str, Any]:
    return {"value": value, "interval": [value - 1.0, value + 1.0], "falls": 0, "episodes": 10}


def metrics(before: float, after: float, low: float, high: float) -> dict[str, Any]:
    return {
        "best": "generation_01",
        "best_generation": 1,
        "policies": 1,
        "returned_value_sim": after,
        "baseline": measured(before),
        "returned": measured(after),
        "gain": {"value": after - before, "interval": [low, high], "share": None},
        "real_episodes": 30,
    }


def evaluation(*figures: float) -> Artifact:
    return cast(Artifact, SimpleNamespace(metrics=metrics(*figures), folder="runs/x"))


@pytest.mark.parametrize(
    ("figures", "end"),
    [
        ((-6.0, -23.3, -35.0, 0.3), "95 % interval -35.0 to +0.3: no better than π0; 30 real episodes"),
        ((-6.0, -23.3, -35.0, -0.3), "95 % interval -35.0 to -0.3: worse than π0; 30 real episodes"),
        ((-6.0, -4.0, -1.0, 5.0), "95 % interval -1.0 to +5.0, which is not significant; 30 real episodes"),
        ((-6.0, -4.0, 1.0, 3.0), "95 % interval +1.0 to +3.0; 30 real episodes"),
    ],
)
def test_a_value_is_never_its_gain(figures: tuple[float, ...], end: str) -> None:
    sentence = describe_choice(metrics(*figures), Unit())
    assert sentence.startswith(
        f"generation_01 is returned: on fresh episodes {figures[1]:.1f}, no falls in 10; π0 -6.0; gain "
    )
    assert sentence.endswith(end)


def test_a_policy_alone_is_better_than_none() -> None:
    alone = {**metrics(-6.0, -6.0, 0.0, 0.0), "best": "pi0", "best_generation": 0, "policies": 0}
    sentence = describe_choice(alone, Unit())
    assert sentence == "π0 alone was measured: -6.0 (95 % -7.0 to -5.0), no falls in 10; 30 real episodes"


def test_the_verdict_says_which_iteration_is_returned_and_why_there_are_no_more() -> None:
    rounds = Rounds(OwnReward())
    rounds.add(evaluation(-20.0, -14.6, 3.0, 8.0), 10)
    assert "no other follows" not in rounds.verdict
    rounds.add(evaluation(-14.2, -13.4, -2.0, 4.0), 10)
    assert "returned by iteration 1 -14.6" in rounds.verdict
    assert "The gain of iteration 2 is not sure: no other follows." in rounds.verdict


def test_an_iteration_that_ends_at_its_grounding_costs_what_it_collected() -> None:
    rounds = Rounds(OwnReward())
    rounds.add(evaluation(-20.0, -14.6, 3.0, 8.0), 10)
    spent = rounds.metrics()["real_episodes"]
    row = rounds.add_refusal("it is no nearer", 7)
    metrics = rounds.metrics()
    assert (row[0], row[1], row[-1], len(row)) == ("2", "grounding refused", "7", len(rounds.columns))
    assert rounds.rows[-1] == row and metrics["returned_iteration"] == 1
    assert "The grounding of iteration 2 was refused: it is no nearer." in metrics["verdict"]
    assert (metrics["real_episodes"], metrics["learned_from"], metrics["stopped_by_itself"]) == (spent + 7, 17, True)


def test_a_value_that_somebody_wrote_down_stands_beside_a_log() -> None:
    logged, written = Episode(0.2, False, 50, {"speed [cm/s]": 20.0}), Episode(0.3, False, 50, {})
    for done in ([logged, written], [written, logged]):
        assert summary(done)["outcome"] == {} and summary(done)["value"] == pytest.approx(0.25)
    assert summary([logged, logged])["outcome"] == {"speed [cm/s]": 20.0}
    row = {**summary([logged, written]), "value_sim": None}
    assert cells(row, "pi0", Unit(), ["speed [cm/s]"])[-1] == ""


def test_where_pi0_is_returned_nothing_is_gained() -> None:
    rounds = Rounds(OwnReward())
    rounds.add(evaluation(-20.0, -21.0, -3.0, 1.0), 10)
    assert (metrics := rounds.metrics())["returned"] == measured(-20.0) and metrics["returned_iteration"] == 0
    assert metrics["gain"] == {"value": 0.0, "interval": [0.0, 0.0], "share": None}
    rounds = Rounds(OwnReward())
    rounds.add(evaluation(-20.0, -14.6, 3.0, 8.0), 10)
    assert rounds.metrics()["gain"] == {"value": -14.6 + 20.0, "interval": [3.0, 8.0], "share": None}


@pytest.mark.parametrize(
    ("after", "low", "title"),
    [
        (-14.6, 3.0, "Real side: -14.6, π0 -20.0"),
        (-19.5, -3.0, "Real side: -19.5, π0 -20.0; the gain is not significant"),
        (-21.0, -3.0, "Real side: π0 is returned, -20.0"),
    ],
)
def test_a_curve_says_what_the_table_says(after: float, low: float, title: str) -> None:
    rounds = Rounds(OwnReward())
    rounds.add(evaluation(-20.0, after, low, 8.0), 10)
    assert rounds.title == title


def test_a_curve_says_what_came_out_without_grounding() -> None:
    rounds = Rounds(Walk())
    rounds.add(evaluation(0.2, 0.25, 0.02, 0.08), 10)
    rounds.add_beside(evaluation(0.2, 0.22, 0.01, 0.03))
    assert rounds.title == "Real side: 25.0 cm/s with grounding, 22.0 without, π0 20.0"
    without = rounds.answer.more[-1]
    assert without.startswith("Without grounding the same search returned a policy with 22.0 cm/s (95 % ")
    assert without.endswith("), no falls in 10 fresh episodes.")


@pytest.mark.parametrize(
    ("without", "end"),
    [
        (-14.0, "is significant. The policy is not better than that of the search without grounding, -14.0."),
        (
            -15.5,
            "is significant. One run does not show that the policy is better than that of the search without "
            "grounding, -15.5.",
        ),
        (-19.0, "is significant."),
    ],
)
def test_grounding_gets_no_credit_for_what_the_search_finds_without_it(without: float, end: str) -> None:
    rounds = Rounds(OwnReward())
    rounds.add(evaluation(-20.0, -14.6, 3.0, 8.0), 10)
    assert rounds.answer.sure
    rounds.add_beside(evaluation(-20.0, without, 0.5, 8.0))
    assert rounds.answer.sentence.endswith(end) and rounds.answer.sure == (without < -14.6)
    assert ("not" in rounds.verdict) == (without > -19.0)
    assert [row[-2] for row in rounds.rows[1:]] == ["+5.4 over π0", f"{without + 20.0:+.1f} over π0"]


def test_an_environment_that_ends_has_not_fallen() -> None:
    robot, environment = Rounds(Walk()), Rounds(OwnReward())
    for rounds in (robot, environment):
        rounds.add(evaluation(-20.0, -14.6, 3.0, 8.0), 10)
    assert "falls" in robot.columns and ", 0 falls in 10 fresh episodes." in robot.verdict
    assert "falls" not in environment.columns and "(95 %), 10 fresh episodes." in environment.verdict
    assert [row[5] for row in robot.rows] == ["0 of 10"] * 2
    assert [row[5] for row in environment.rows] == ["10"] * 2
    assert Unit.of(OwnReward).describe_ends(measured(1.0)) == "10 episodes"


def test_a_gain_over_nothing_has_no_share() -> None:
    around = [cast(Any, SimpleNamespace(value=value, fell=False)) for value in (-1.0, 0.5, 1.0)]
    assert gain(around, around)["share"] is None


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "+0.0"), (-17.23, "-17.2"), (0.06, "+0.06"), (0.643, "+0.64"), (-0.0082, "-0.0082"), (5000.0, "+5000.0")],
)
def test_values_of_an_environment_are_told_whatever_their_size(value: float, text: str) -> None:
    assert Unit.of(OwnReward()).bare(value, sign=True) == text
    assert Unit.of(Walk()).bare(0.0043) == "0.4"  # cm/s, whose size is known


def test_a_gain_below_one_is_told() -> None:
    rounds = Rounds(OwnReward())
    rounds.add(evaluation(0.06, 0.64, 0.43, 0.73), 10)
    assert "gain of the last step +0.43 to +0.73 (95 %)" in rounds.verdict


@pytest.mark.parametrize(
    ("checked", "remark"),
    [
        ({}, ""),
        ({"grounding_acceptable": True}, ""),
        ({"grounding_acceptable": False}, "; grounding failed its check"),
        ({"alpha": 0.9, "grounding_acceptable": True, "grounding_compared": True}, "; grounding (alpha 0.9) passed"),
        (
            {"alpha": 1.0, "grounding_acceptable": True, "grounding_compared": False},
            "; grounding (alpha 1) passed, by the falls of π0 alone",
        ),
    ],
)
def test_a_search_says_how_its_grounding_was_checked(checked: dict[str, Any], remark: str) -> None:
    metrics = {"best_value_sim": 0.25, "generations": 2, **checked}
    manifest = SimpleNamespace(kind="optimize", unit=Unit.of(Walk())._asdict())
    artifact = cast(Artifact, SimpleNamespace(metrics=metrics, manifest=manifest))
    assert headline(artifact) == f"2 generations, best 25.0 cm/s in simulation{remark}"
