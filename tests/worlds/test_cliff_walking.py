"""Cliff Walking and the toy of figures 8 and 9: what GAT and SGAT come to where everything can be counted."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commands import done

from gsl.core.table import Table
from gsl.core.trajectory import Trajectory
from gsl.errors import InputError
from gsl.grounding.states import TableTransformation
from gsl.models.counts import Counts, count_transitions
from gsl.worlds.cliff_walking import CliffWalking
from gsl.worlds.gymnasium import GymnasiumWorld
from gsl_experiments.table_episodes import play

pytestmark = pytest.mark.slow

DOWN = 2
EDGE = {0.0: 98.70, 0.1: 73.62, 0.5: 23.05, 0.8: -3.83, 1.0: -10.90}  # the path along the edge, exact
BEST = {0.0: 98.70, 0.1: 95.00, 0.5: 63.71, 0.8: 2.19, 1.0: -10.90}  # of the real world's own optimum


def the_cliff_world(noise: float) -> GymnasiumWorld:
    return GymnasiumWorld(env_id="gsl.worlds.cliff_walking:CliffWalking", kwargs={"noise": noise})


def the_cliff(noise: float = 0.0) -> Table:
    return the_cliff_world(noise).table


@pytest.mark.parametrize("noise", EDGE)
def test_exact_values_are_those_that_were_measured_beforehand(noise: float) -> None:
    real = the_cliff(noise)
    along_the_edge = the_cliff().solve(np.full(48, DOWN))
    assert real.value(along_the_edge) == pytest.approx(EDGE[noise], abs=0.01)
    assert real.value(real.solve(along_the_edge)) == pytest.approx(BEST[noise], abs=0.01)


def test_the_environment_moves_as_its_table_says() -> None:
    env, table, rng = CliffWalking(0.6), the_cliff(0.6), np.random.default_rng(0)
    seen, paid = np.zeros_like(table.chances), np.zeros_like(table.chances)
    state, _ = env.reset(seed=0)
    for _ in range(20_000):
        action = int(rng.integers(4))
        after, reward, ended, _, _ = env.step(action)
        seen[state, action, after] += 1
        paid[state, action, after] = reward
        state = env.reset()[0] if ended else after
    assert not (seen[table.chances == 0.0]).any()
    np.testing.assert_allclose(paid[seen > 0], table.rewards[seen > 0])
    often = seen.sum(axis=2) > 400
    shares = seen[often] / seen[often].sum(axis=1, keepdims=True)
    assert np.abs(shares - table.chances[often]).max() < 0.09


def test_episodes_of_a_table_return_what_it_is_worth() -> None:
    real = the_cliff(0.3)
    policy = real.solve(np.full(48, DOWN))
    episodes = play(real, policy, 20_000, np.random.default_rng(1))
    assert episodes.returns.mean() == pytest.approx(real.value(policy), abs=0.6)
    assert not episodes.seen[real.terminal].any()


def test_noise_of_the_world_is_in_its_table() -> None:
    real, disturbed = the_cliff(0.3), replace(the_cliff_world(0.0), action_noise=0.3).table
    np.testing.assert_allclose(disturbed.chances, real.chances)
    np.testing.assert_allclose(disturbed.rewards, real.rewards)


def test_policy_iteration_keeps_its_action_among_equals() -> None:
    flat = Table(np.full((3, 2, 3), 1 / 3), np.zeros((3, 2, 3)), np.array([False, False, True]), np.eye(3)[0])
    np.testing.assert_array_equal(flat.solve(np.array([1, 0, 0])), [1, 0, 0])


def test_a_stochastic_grounding_of_perfect_models_is_the_real_world() -> None:
    sim, real = the_cliff(), the_cliff(0.5)
    grounding = TableTransformation(Counts(real.chances), Counts(sim.chances), draws=True)
    made = grounding.ground(sim)
    inside = ~real.terminal
    np.testing.assert_allclose(made.chances[inside], real.chances[inside], atol=1e-12)
    np.testing.assert_allclose(made.rewards[inside], real.rewards[inside], atol=1e-12)


def test_a_deterministic_grounding_hides_the_noise() -> None:
    sim, real = the_cliff(), the_cliff(0.5)
    made = TableTransformation(Counts(real.chances), Counts(sim.chances)).ground(sim)
    np.testing.assert_allclose(made.chances[~real.terminal], sim.chances[~real.terminal])


@pytest.mark.parametrize(("state", "line"), [(48.0, "state 48 is not one of the 48"), (0.5, "state 0.5 is not one")])
def test_numbers_that_are_no_states_are_refused(state: float, line: str) -> None:
    states, nothing = np.array([[36.0], [state]]), np.zeros((2, 0))
    episode = Trajectory(np.arange(2.0), np.zeros((1, 1)), nothing, nothing, state=states)
    with pytest.raises(InputError, match=line):
        count_transitions([episode], 48, 4)


def test_what_was_never_seen_is_left_alone() -> None:
    sim = the_cliff()
    nothing = TableTransformation(Counts(np.zeros((48, 4, 48))), Counts(sim.chances), draws=True)
    np.testing.assert_array_equal(nothing.chances, np.broadcast_to(np.eye(4), (48, 4, 4)))


def a_toy() -> tuple[Table, Table]:
    """Figures 8 and 9 in numbers: one choice, ends worth -10, 1 and 5.

    In the simulator a1, a2 and a3 lead to the three ends in order. In the real world a1 leads to 5 with a chance of .6,
    else to -10 (worth -1); a2 surely to 1; a3 to 1 with .6, else to -10 (worth -3.4).
    """
    ends, terminal, start = np.array([0.0, -10.0, 1.0, 5.0]), np.array([False, True, True, True]), np.eye(4)[0]
    sim, real = np.zeros((4, 3, 4)), np.zeros((4, 3, 4))
    sim[0, [0, 1, 2], [1, 2, 3]] = 1.0
    real[0, 0, [3, 1]], real[0, 1, 2], real[0, 2, [2, 1]] = (0.6, 0.4), 1.0, (0.6, 0.4)
    rewards = np.broadcast_to(ends, (4, 3, 4))
    return Table(sim, rewards, terminal, start), Table(real, rewards, terminal, start)


def test_in_the_toy_gat_misses_the_real_optimum_and_sgat_finds_it() -> None:
    sim, real = a_toy()
    forward, inverse = Counts(real.chances), Counts(sim.chances)
    grounded = {
        draws: TableTransformation(forward, inverse, draws).ground(sim).solve(np.zeros(4, dtype=int))[0]
        for draws in (False, True)
    }
    optima = [world.solve(np.zeros(4, dtype=int))[0] for world in (sim, real)]
    assert optima == [2, 1], "a3 is the optimum of the simulator, a2 of the real world"
    assert grounded == {False: 0, True: 1}, "GAT takes a1, whose likeliest end is the best one; SGAT takes a2"


def test_figure_11_is_one_command(tmp_path: Path) -> None:
    said = done("reproduce", "fig11", "preset=toy", "trials=2", "noises=[0.0,0.5]", folder=tmp_path)
    folder = tmp_path / "runs/fig11/reproduce"
    points = json.loads((folder / "points.json").read_text())
    values = {(point["method"], point["noise"]): point["value"] for point in points}
    assert values["sgat", 0.5] > 0.9 * BEST[0.5] > values["gat", 0.5]
    assert values["gat", 0.0] == values["sgat", 0.0] == pytest.approx(EDGE[0.0])
    assert all(abs(point["estimate"] - point["value"]) < 3.0 for point in points)
    assert (folder / "figure_11.png").stat().st_size > 10_000
    assert "real optimum" in said.out


def test_the_command_of_the_docs_finds_the_safe_path(tmp_path: Path) -> None:
    done("iterate", "experiment=cliff_walking", "name=cliff", "workers=1", folder=tmp_path)
    metrics = json.loads((tmp_path / "runs/cliff/iterate/metrics.json").read_text())
    assert metrics["gain"]["interval"][0] > 0.0
    returned = json.loads((tmp_path / "runs/cliff/iterate/policies.json").read_text())["policies"][-1]
    actions = np.array([returned["parameters"][f"action_in_{state}"] for state in range(48)], dtype=int)
    assert the_cliff(0.5).value(actions) > 0.94 * BEST[0.5] > EDGE[0.5]


def test_the_chain_of_stages_grounds_the_cliff(tmp_path: Path) -> None:
    few = ("recipe.real_episodes=60", "recipe.sim_episodes=100", "workers=1", "budget.episodes=2")
    few = (*few, "recipe.real_action_noise=0")  # π0 is checked with the noise of its real episodes
    done("iterate", "experiment=cliff_walking", "preset=toy", *few, "name=c", folder=tmp_path)
    report = json.loads((tmp_path / "runs/c/iteration_01/optimize/grounding.json").read_text())
    values = {name: np.mean(figures["values"]) for name, figures in report["pi0"].items()}
    assert values["ungrounded"] == pytest.approx(98.7)
    assert values["grounded"] < 80.0
