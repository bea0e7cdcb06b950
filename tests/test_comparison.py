"""The table of a comparison counts failures as they are."""

from __future__ import annotations

import math

import pytest

from gsl.stages.comparison import Trial, markdown, rows, summaries


def _trial(method: str, number: int, gain: float, generation: int, stable: int = 3) -> Trial:
    metrics = {
        "gain": {"share": gain},
        "best": f"generation_{generation:02d}" if generation else "pi0",
        "best_generation": generation,
        "stable_policies": stable,
        "improving_policies": stable - 1,
        "policies": 5,
        "unconfirmed": [],
        "real_episodes": 40,
    }
    return Trial.of("nao_worn", method, number, metrics)


TRIALS = [_trial("gat", 1, 0.2, 4), _trial("gat", 2, 0.1, 2), _trial("none", 1, 0.0, 0, 1), _trial("none", 2, -0.05, 1)]


def test_a_failed_trial_counts_as_no_improvement() -> None:
    gat, none = summaries(TRIALS)
    assert (gat.improvement, gat.without, gat.generation) == (pytest.approx(15.0), 0, 3.0)
    assert (none.improvement, none.without) == (0.0, 2)
    assert math.isnan(none.generation)


def test_winners_are_counted_over_all_trials() -> None:
    gat, none = summaries(TRIALS)
    assert (gat.stable, gat.improving, gat.winners) == (6, 4, 10)
    assert (none.stable, none.winners) == (4, 10)


def test_the_table_shows_every_method_and_every_trial() -> None:
    text = markdown(summaries(TRIALS), TRIALS)
    assert "20.0, 10.0" in text and "0.0, -5.0" in text
    assert len(rows(summaries(TRIALS))) == 2
