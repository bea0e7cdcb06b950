"""A race stops candidates, keeps the winner that all rollouts would have, and hardly changes the search's step."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scenarios import AIR, QUIET, REACH

from gsl.core.statistics import wilson
from gsl.grounding.ane import ActionNoise
from gsl.optimizers.cma_es import CmaEs
from gsl.optimizers.objective import objective_values
from gsl.optimizers.race import Race, Racing, draw_ends, noise_share, weigh
from gsl.stages.optimize import Optimize
from gsl.storage.policies import read_policies
from gsl.tasks.arm import Arm

pytestmark = pytest.mark.slow

MEAN = partial(objective_values, objective="mean", quantile=0.25)
CANDIDATES, ROLLOUTS, ERROR = 24, 20, 0.05
LATITUDE = 3.0  # of what a race expects of the step: 1.5 by the mean, 2.5 by cvar where walks fall


def run_race(returns: np.ndarray, error: float, seed: int = 0, judge: partial[np.ndarray] = MEAN) -> Race:
    """Play a race on returns that are known beforehand, shape (n, k)."""
    race = Race(*returns.shape, error, judge, np.random.default_rng(seed))
    while pairs := race.pairs():
        race.take([returns[pair] for pair in pairs])
    return race


def winner(race: Race) -> int:
    """The best of those that have played everything."""
    return int(np.argmax(np.where(race.counts == race.values.shape[1], race.worths, -np.inf)))


def change_of_step(race: Race, whole: np.ndarray) -> float:
    """Squared change of the weights by the race, as a share of all squared weights; worths by all rollouts: (n,)."""
    right = weigh(whole)
    return float(((weigh(race.worths) - right) ** 2).sum() / (right**2).sum())


def walks(rng: np.random.Generator, noise: float, falls: float) -> np.ndarray:
    """Returns like those of walks [cm/s]: each candidate has its speed and its own share of falls."""
    speed = rng.normal(25.0, 3.0, size=(CANDIDATES, 1))
    values = speed + noise * rng.standard_normal((CANDIDATES, ROLLOUTS))
    fell = rng.random(values.shape) < falls * 2.0 * rng.random((CANDIDATES, 1))
    return np.where(fell, rng.uniform(-15.0, 10.0, size=values.shape), values)


@pytest.mark.parametrize(
    ("noise", "falls", "objective"),
    [(0.1, 0.0, "mean"), (3.0, 0.0, "mean"), (0.1, 0.2, "mean"), (0.1, 0.2, "cvar"), (1.0, 0.05, "cvar")],
)
def test_another_winner_is_no_more_frequent_than_the_stated_error(noise: float, falls: float, objective: str) -> None:
    judge = partial(objective_values, objective=objective, quantile=0.25)
    trials, wrong, played, changes = 40, 0, [], []
    for seed in range(trials):
        returns = walks(np.random.default_rng(seed), noise, falls)
        race = run_race(returns, ERROR, seed, judge)
        wrong += winner(race) != int(np.argmax(judge(returns)))
        played.append(race.counts.sum() / returns.size)
        changes.append(change_of_step(race, judge(returns)))
    assert wilson(wrong, trials).lower <= ERROR
    assert np.mean(changes) < LATITUDE * ERROR
    assert np.mean(played) < 0.95


def test_candidates_far_apart_play_two_rollouts_and_the_winner_all() -> None:
    returns = np.linspace(0.0, 1.0, CANDIDATES)[:, None] + 1e-3 * np.random.default_rng(0).random((1, ROLLOUTS))
    race = run_race(returns, ERROR)
    assert winner(race) == CANDIDATES - 1
    assert race.counts[-1] == ROLLOUTS
    assert race.counts[0] <= 8
    assert race.counts.sum() < 0.5 * returns.size


def test_candidates_near_the_border_of_the_better_half_play_no_more_than_those_far_below() -> None:
    """By all rollouts their order is chance, and they count almost nothing: only the leaders have to be told apart."""
    rng, played = np.random.default_rng(0), np.zeros(CANDIDATES)
    for seed in range(10):
        leaders, others = np.linspace(30.0, 27.0, 6), np.full(CANDIDATES - 6, 20.0)
        returns = np.concatenate([leaders, others])[:, None] + rng.standard_normal((CANDIDATES, ROLLOUTS))
        played += run_race(returns, ERROR, seed).counts / 10
    assert played[0] == ROLLOUTS
    assert played[6:].mean() < 0.5 * ROLLOUTS


@pytest.mark.parametrize("candidates", [4, 7, 24, 150])
def test_weights_are_those_by_which_cma_moves_its_mean(candidates: int) -> None:
    from cma.recombination_weights import RecombinationWeights

    worths = np.random.default_rng(0).permutation(candidates).astype(float)
    weights, right = weigh(worths), RecombinationWeights(candidates).positive_weights
    by_rank = weights[np.argsort(-worths)]
    np.testing.assert_allclose(by_rank[: len(right)], right)
    np.testing.assert_allclose(by_rank[len(right) :], 0.0, atol=1e-12)
    np.testing.assert_array_equal(weigh(np.stack([worths, -worths]))[0], weights)


def test_a_search_s_mean_is_that_of_its_candidates_by_these_weights() -> None:
    search = CmaEs(candidates=8, generations=2, sigma=0.2).start(np.arange(3.0), np.array([1.0, 2.0, 3.0]), 1)
    asked, values = np.array(search.ask()), np.random.default_rng(0).normal(size=8)
    search.tell(values.tolist())
    np.testing.assert_allclose(search.mean, weigh(values) @ asked)


def test_without_an_error_every_candidate_plays_everything_in_one_round() -> None:
    returns = walks(np.random.default_rng(0), 1.0, 0.1)
    race = Race(*returns.shape, 0.0, MEAN, np.random.default_rng(0))
    assert race.pairs() == [(n, k) for n in range(CANDIDATES) for k in range(ROLLOUTS)]
    race.take(returns.ravel().tolist())
    assert race.pairs() == []
    np.testing.assert_array_equal(race.worths, returns.mean(axis=1))


@pytest.mark.parametrize("strange", [np.nan, -np.inf])
def test_nobody_stops_where_a_return_is_no_number(strange: float) -> None:
    returns = np.linspace(0.0, 1.0, CANDIDATES)[:, None] + np.zeros((1, ROLLOUTS))
    returns[3, 1] = strange
    assert (run_race(returns, ERROR).counts == ROLLOUTS).all()


def test_a_single_candidate_plays_everything() -> None:
    assert run_race(np.zeros((1, 5)), 0.3).counts.tolist() == [5]


@pytest.mark.parametrize("rollouts", [1, 2, 3, 7])
def test_a_race_of_any_length_ends_with_a_winner_that_played_it_all(rollouts: int) -> None:
    race = run_race(np.random.default_rng(0).normal(size=(6, rollouts)), 0.3)
    assert race.counts.max() == rollouts
    assert race.counts.min() >= min(2, rollouts)


def test_the_urn_keeps_what_was_played_and_draws_the_rest_as_its_law_says() -> None:
    values = np.array([[0.0, 0.0, np.nan, np.nan], [1.0, 1.0, np.nan, np.nan]])
    assert noise_share(values) == 0.0  # so that the urn has one strange ball
    ends = draw_ends(values, 40_000, np.random.default_rng(0))
    np.testing.assert_array_equal(ends[:, :, :2], np.broadcast_to(values[:, :2], ends[:, :, :2].shape))
    # By hand: the third is of the other kind with 1/3 * 1/2; so is the fourth, as the urn's draws are exchangeable.
    assert ends[:, 0, 2:].mean(axis=0) == pytest.approx([1 / 6, 1 / 6], abs=0.01)
    # Both are: 1/6 for the third, then one ball of four, or the base with 1/4 * 1/2.
    assert ends[:, 0, 2:].all(axis=1).mean() == pytest.approx(1 / 6 * (1 / 4 + 1 / 8), abs=0.005)


def test_the_share_of_noise_is_that_of_the_law_that_made_the_values() -> None:
    rng = np.random.default_rng(0)
    values = 2.0 * rng.standard_normal((4000, 1)) + 3.0 * rng.standard_normal((4000, 8))
    values[:2000, 5:] = np.nan
    assert noise_share(values) == pytest.approx(9.0 / 4.0, rel=0.1)


def _search(race: float, workers: int = 1) -> Optimize:
    optimizer = CmaEs(candidates=8, generations=3, sigma=0.2, race=race)
    return Optimize(AIR, Arm(duration=0.6), REACH, ActionNoise(0.02), optimizer, rollouts=8, workers=workers)


@pytest.mark.slow
def test_a_raced_search_is_the_same_with_more_workers_and_after_a_kill(tmp_path: Path) -> None:
    files = {}
    for workers in (1, 2):
        folder = tmp_path / str(workers)
        folder.mkdir()
        _search(0.1, workers).run(folder, QUIET)
        files[workers] = {name: (folder / name).read_bytes() for name in ("policies.json", "generations.jsonl")}
    assert files[1] == files[2]
    log = tmp_path / "1" / "generations.jsonl"
    lines = log.read_text().splitlines(keepends=True)
    log.write_text(lines[0] + lines[1][:20])  # as a kill leaves it
    _search(0.1).run(tmp_path / "1", QUIET)
    assert {name: (tmp_path / "1" / name).read_bytes() for name in files[1]} == files[1]


@pytest.mark.slow
def test_a_raced_search_starts_as_the_whole_one_does_and_plays_less(tmp_path: Path) -> None:
    winners = {}
    for race in (0.0, 0.1):
        folder = tmp_path / f"{race:g}"
        folder.mkdir()
        _search(race).run(folder, QUIET)
        winners[race] = read_policies(folder / "policies.json").records[1]
    assert winners[0.0] == winners[0.1]  # the winner of the first generation, and its value
    logged = [json.loads(line) for line in (tmp_path / "0.1" / "generations.jsonl").read_text().splitlines()]
    assert sum(sum(line["played"]) for line in logged) < 3 * 8 * 8
    assert "played" not in (tmp_path / "0" / "generations.jsonl").read_text()


def test_cma_es_races_and_says_by_how_much() -> None:
    plain = CmaEs(candidates=4, generations=1)
    assert isinstance(plain, Racing)
    assert (plain.race, replace(plain, race=0.1).race) == (0.0, 0.1)
