"""The tables of a comparison count losses, falls and real episodes as they are."""

from __future__ import annotations

import pytest

from gsl.core.unit import Unit
from gsl.tasks.own_reward import OwnReward
from gsl.tasks.walk import Walk
from gsl_experiments.answer import answer_comparison
from gsl_experiments.comparison import differences, orders, summaries
from gsl_experiments.comparison_table import markdown
from gsl_experiments.paper_cells import every_trial, one_by_one, worth
from gsl_experiments.paper_table_2 import Table2
from gsl_experiments.trial import Cell, Trial


def _trial(method: str, number: int, gain: float, generation: int, stable: int = 3, falls: int = 0) -> Trial:
    measured = {
        "gain": {"value": 0.25 * gain, "interval": [0.25 * (gain - 0.02), 0.25 * (gain + 0.02)]},
        "baseline": {"value": 0.25, "interval": [0.24, 0.26]},
        "returned": {"value": 0.25 * (1.0 + gain), "falls": falls, "episodes": 10, "outcome": {}},
        "last": {"outcome": {}, "falls": 1},
        "best": f"generation_{generation:02d}" if generation else "pi0",
        "best_generation": generation,
        "stable_policies": stable,
        "improving_policies": stable - 1,
        "policies": 5,
        "real_episodes": 40,
    }
    search = {"alpha": 1.0, "grounding_acceptable": number > 1} if method == "gat" else {}
    cell = Cell("", "nao_worn", method, 1)
    return Trial.of(cell, number, search, measured, spent=30 if method == "gat" else 0)


TRIALS = [_trial("none", 1, 0.0, 0, 1), _trial("none", 2, -0.05, 1), _trial("gat", 1, 0.2, 4), _trial("gat", 2, 0.1, 2)]


def test_a_loss_counts_as_what_it_is() -> None:
    none, gat = summaries(TRIALS)
    assert (gat.improvement.mean, gat.without, gat.generation) == (pytest.approx(15.0), 0, 3.0)
    assert (none.improvement.mean, none.without, none.generation) == (pytest.approx(-2.5), 2, 1.0)


def test_where_nothing_new_was_returned_no_generation_is_told() -> None:
    (none,) = summaries([_trial("none", 1, 0.0, 0, 1)])
    assert (none.generation, none.best_generation) == (None, "")
    assert summaries(TRIALS)[0].best_generation == "1.0"


def test_a_fall_in_fresh_episodes_is_a_trial_without_improvement() -> None:
    assert _trial("gat", 1, 0.2, 4, falls=1).without and not _trial("gat", 1, 0.2, 4).without


def test_a_gain_that_may_be_none_is_none() -> None:
    assert _trial("none", 1, 0.01, 1).without


def test_real_episodes_of_models_are_counted_and_refusals_told() -> None:
    none, gat = summaries(TRIALS)
    assert (none.real_episodes, gat.real_episodes) == (40, 70)
    assert (none.refused, gat.refused) == (0, 1)


def test_differences_are_paired_by_trial() -> None:
    difference = differences(TRIALS, Cell("", "nao_worn", "gat", 1), "none")
    assert difference.mean == pytest.approx((20.0 - 0.0 + 10.0 + 5.0) / 2)


def test_a_sentence_says_which_search_is_the_best_if_that_is_significant_and_none_is_no_name() -> None:
    unit = Unit(100.0, "cm/s")
    sure = [*(_trial("none", k, 0.01 * k, 4) for k in (1, 2)), *(_trial("gat", k, 0.2 + 0.02 * k, 4) for k in (1, 2))]
    answer = answer_comparison(summaries(sure), sure, unit)
    assert answer.sure and answer.sentence.startswith("In nao_worn, gat is best of 2 methods with 30.75 cm/s (95 % ")
    assert answer.sentence.endswith("), which is significant.")
    sentence = answer_comparison(summaries(TRIALS), TRIALS, unit).sentence
    nothing = (
        "In nao_worn, no difference between gat and the search without grounding is significant: 28.75 cm/s (95 % "
    )
    assert sentence.startswith(nothing) and ") and 24.38 cm/s; " in sentence
    assert "; gat minus the search without grounding: +4.38 cm/s (95 % " in sentence  # 0.25 · (0.2 + 0.15) / 2
    losses = [*TRIALS[:2], _trial("gat", 1, -0.2, 4), _trial("gat", 2, -0.1, 2)]
    answer = answer_comparison(summaries(losses), losses, unit)
    assert "; the search without grounding minus gat: +3.12 cm/s (95 % " in answer.sentence  # 0.25 · (0.2 + 0.05) / 2


def test_winners_are_counted_over_all_trials() -> None:
    none, gat = summaries(TRIALS)
    assert (gat.stable, gat.improving, gat.winners) == (6, 4, 10)
    assert (none.stable, none.winners) == (4, 10)


def test_the_tables_show_every_method_and_every_trial() -> None:
    text = markdown(summaries(TRIALS), TRIALS, Unit.of(Walk))
    assert "20.0, 10.0" in text and "0.0*, -5.0*" in text
    assert "| nao_worn | gat - none | +17.5 |" in text and "falls in fresh episodes" in text
    assert "| nao_worn | gat | 28.7 (" in text  # cm/s
    alone = [trial for trial in TRIALS if trial.method == "gat"]
    assert "paired by trial" not in markdown(summaries(alone), alone, Unit.of(Walk))


def test_iterations_are_told_apart_where_there_are_several() -> None:
    trials = [*TRIALS, *(trial._replace(iteration=2, value=0.3, improvement=20.0) for trial in TRIALS)]
    text = markdown(summaries(trials), trials, Unit.of(Walk))
    assert "| nao_worn | 1 | gat | 20.0, 10.0 |" in text and "| nao_worn | 2 | gat | 20.0, 20.0 |" in text
    assert "| nao_worn | 1 | gat - none | +17.5 |" in text and "| nao_worn | 2 | gat - none | +0.0 |" in text
    assert "stable improvement by that iteration:" in text and "iteration" not in markdown(
        summaries(TRIALS), TRIALS, Unit.of(Walk)
    )


def test_a_mean_improvement_is_one_of_all_trials() -> None:
    trials = [TRIALS[0], TRIALS[1]._replace(improvement=None)]
    assert {trial.method for trial in trials} == {TRIALS[0].method}
    assert summaries(trials)[0].improvement is None


def test_without_falls_and_percentages_the_tables_tell_returns() -> None:
    trials = [trial._replace(improvement=None) for trial in TRIALS]
    text = markdown(summaries(trials), trials, Unit.of(OwnReward))
    assert "falls" not in text and "stable winners" not in text
    assert "| nao_worn | gat | 0.30, 0.28 |" in text and "| nao_worn | gat - none | +0.04 |" in text


def test_an_order_is_claimed_by_a_signed_rank_test_over_trials_with_holms_correction() -> None:
    counts = {"none": [1, 0, 2, 1, 0, 1], "ane": [1, 1, 2, 0, 1, 1], "gat": [4, 5, 5, 4, 3, 5]}
    trials = [
        _trial(method, number + 1, 0.1, 2, stable)
        for method, stables in counts.items()
        for number, stable in enumerate(stables)
    ]
    by_pair = {
        (order.method, order.other): order
        for order in orders(trials, "", "nao_worn", ("gat", "ane"), ("none", "ane", "some"))
    }
    assert by_pair["gat", "none"].difference == pytest.approx(21 / 6)
    assert (
        by_pair["gat", "none"].p == by_pair["gat", "ane"].p == pytest.approx(3 * 2 / 2**6)
    )  # least of 6 pairs, times 3
    assert by_pair["ane", "none"].p == 1.0


def test_a_start_that_may_be_worth_nothing_has_no_percentage() -> None:
    measured = {
        "gain": {"value": 0.03, "interval": [0.02, 0.04]},
        "baseline": {"value": 0.001, "interval": [-0.001, 0.003]},
        "returned": {"value": 0.031, "falls": 0, "episodes": 10, "outcome": {}},
        "last": {"outcome": {}, "falls": 1},
        "best": "generation_02",
        "best_generation": 2,
        "stable_policies": 3,
        "improving_policies": 3,
        "policies": 5,
        "real_episodes": 40,
    }
    trial = Trial.of(Cell("", "w", "gat", 1), 1, {}, measured, spent=0)
    assert trial.improvement is None and not trial.without
    (summary,) = summaries([trial])
    assert (summary.improvement, summary.value.mean) == (None, 0.031)


def test_a_share_of_next_to_nothing_is_told_nowhere() -> None:
    trials = [_trial("gat", 1, 0.2, 4), _trial("gat", 2, 0.2, 4)._replace(start=0.001, improvement=29900.0)]
    (summary,) = summaries(trials)
    assert summary.improvement is None and summary.value.mean == pytest.approx(0.3)
    speed = Unit.of(Walk())
    tables = markdown([summary], trials, speed), Table2().markdown(trials, Walk()), every_trial(trials)
    assert "29900" not in "".join([*tables, one_by_one(trials, Walk()), trials[1].describe(speed)])
    assert worth(trials, Walk()).values == pytest.approx([30.0, 30.0])


def test_later_iterations_are_set_against_the_first_ones_start() -> None:
    first = _trial("gat", 1, 0.2, 4)
    later = {
        "gain": {"value": 0.01, "interval": [0.0, 0.02]},
        "baseline": {"value": 0.30, "interval": [0.29, 0.31]},
        "returned": {"value": 0.31, "falls": 0, "episodes": 10, "outcome": {}},
        "last": {"outcome": {}, "falls": 1},
        "best": "generation_01",
        "best_generation": 1,
        "stable_policies": 3,
        "improving_policies": 3,
        "policies": 5,
        "real_episodes": 40,
    }
    start = {"baseline": {"value": 0.25, "interval": [0.24, 0.26]}}
    second = Trial.of(Cell("", "nao_worn", "gat", 2), 1, {}, later, spent=first.real_episodes, first=start)
    assert second.improvement == pytest.approx(24.0)
    assert second.real_episodes == first.real_episodes + 40
    assert second.without  # the second iteration's gain may be none
    assert [summary.iteration for summary in summaries([first, second])] == [1, 2]
