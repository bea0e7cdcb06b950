"""What tells beforehand which policies fall: counted by hand on made-up trials."""

from __future__ import annotations

import numpy as np
import pytest

from gsl.core.statistics import concordance
from gsl.studies.trial import Trial
from gsl.studies.tried import Tried, foretold


def test_concordance_is_the_share_of_pairs_that_agree_and_half_of_those_that_tie() -> None:
    assert concordance([1.0, 2.0, 3.0, 4.0], [0, 0, 1, 1]) == 1.0
    assert concordance([4.0, 3.0, 2.0, 1.0], [0, 0, 1, 1]) == 0.0
    assert concordance([1.0, 3.0, 3.0], [0, 0, 1]) == pytest.approx(0.75)
    assert concordance([2.0, 1.0, 3.0], [0, 1, 5]) == pytest.approx(2 / 3)  # pairs 0-1 wrong, 0-2 and 1-2 right
    assert np.isnan(concordance([1.0, 2.0], [1, 1]))


def a_trial(number: int, method: str, drift: float | None, *falls: int) -> Trial:
    """A search whose promises rise with each generation, and its falls in one to five episodes of the choice."""
    found = [Tried(k, 0.1 * k, drift, fell, 1 if fell else 5, 0.2) for k, fell in enumerate(falls, start=1)]
    start = Tried(0, None, drift, 1, 5, 0.2)  # which fell, and is not among them
    some = {"start": 0.2, "value": 0.2, "improvement": 0.0, "surely": 0.0, "returned": "pi0", "generation": 0}
    counts = {"falls": 0, "episodes": 20, "stable": falls.count(0), "improving": 0, "winners": len(falls)}
    rest = {"alpha": None, "refused": False, "rank": None, "real_episodes": 9, "outcome": {}, "last": {}}
    return Trial("", "w", method, 1, number, **some, **counts, **rest, tried=[list(one) for one in (start, *found)])


def test_a_promise_that_tells_who_falls_is_told_with_its_interval_over_trials() -> None:
    trials = [
        a_trial(1, "gat", 0.5, 0, 0, 1, 1),  # the two of the largest promise fall
        a_trial(2, "gat", 0.5, 0, 1, 0, 1),  # three of four pairs
        a_trial(3, "gat", 0.5, 1, 1, 1, 1),  # all fall, which tells nothing
        a_trial(1, "none", None, 1, 0, 0, 0),
    ]
    told = foretold(trials)
    assert "| w | gat | 1 | 8 of 12 | 2 of 3 | 0.88 (0.00 to 1.00) | 0.88 (0.00 to 1.00) | 0.50 (0.50 to 0.50) |" in told
    assert "| w | none | 1 | 1 of 4 | 1 of 1 | 0.00 | 0.00 |  |" in told


def test_nothing_is_told_of_trials_without_a_fall_or_of_those_that_kept_none() -> None:
    assert foretold([a_trial(1, "gat", 0.5, 0, 0)]) == ""
    assert foretold([a_trial(1, "gat", 0.5, 1, 0)._replace(tried=None)]) == ""
