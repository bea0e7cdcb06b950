"""The tables of a comparison count losses, falls and real episodes as they are."""

from __future__ import annotations

import pytest

from gsl.stages.comparison import Trial, differences, markdown, rows, summaries


def _trial(method: str, number: int, gain: float, generation: int, stable: int = 3, falls: int = 0) -> Trial:
    measured = {
        "gain": {"value": 0.25 * gain, "interval": [0.25 * (gain - 0.02), 0.25 * (gain + 0.02)]},
        "baseline": {"value": 0.25},
        "returned": {"falls": falls},
        "best": f"generation_{generation:02d}" if generation else "pi0",
        "best_generation": generation,
        "stable_policies": stable,
        "improving_policies": stable - 1,
        "policies": 5,
        "real_episodes": 40,
    }
    found = {"alpha": 1.0, "grounding_acceptable": number > 1} if method == "gat" else {}
    return Trial.of("nao_worn", method, number, found, measured, 30 if method == "gat" else 0)


TRIALS = [_trial("none", 1, 0.0, 0, 1), _trial("none", 2, -0.05, 1), _trial("gat", 1, 0.2, 4), _trial("gat", 2, 0.1, 2)]


def test_a_loss_counts_as_what_it_is() -> None:
    none, gat = summaries(TRIALS)
    assert (gat.improvement.mean, gat.without, gat.generation) == (pytest.approx(15.0), 0, 3.0)
    assert (none.improvement.mean, none.without, none.generation) == (pytest.approx(-2.5), 2, 1.0)


def test_a_fall_in_fresh_episodes_is_a_trial_without_improvement() -> None:
    assert _trial("gat", 1, 0.2, 4, falls=1).without and not _trial("gat", 1, 0.2, 4).without


def test_a_gain_that_may_be_none_is_none() -> None:
    assert _trial("none", 1, 0.01, 1).without


def test_real_episodes_of_models_are_counted_and_refusals_told() -> None:
    none, gat = summaries(TRIALS)
    assert (none.real_episodes, gat.real_episodes) == (40, 70)
    assert (none.refused, gat.refused) == (0, 1)


def test_differences_are_paired_by_trial() -> None:
    difference = differences(TRIALS, "nao_worn", "gat", "none")
    assert difference.mean == pytest.approx((20.0 - 0.0 + 10.0 + 5.0) / 2)


def test_winners_are_counted_over_all_trials() -> None:
    none, gat = summaries(TRIALS)
    assert (gat.stable, gat.improving, gat.winners) == (6, 4, 10)
    assert (none.stable, none.winners) == (4, 10)


def test_the_tables_show_every_method_and_every_trial() -> None:
    text = markdown(summaries(TRIALS), TRIALS)
    assert "20.0, 10.0" in text and "0.0*, -5.0*" in text and "gat - none" in text
    assert len(rows(summaries(TRIALS))) == 2
