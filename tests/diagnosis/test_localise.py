"""The map of a gap: which cells it names, and what it makes of few trajectories and of joints that shake."""

from dataclasses import replace

import numpy as np
import pytest
from swinging_arm import FEW, arm, found, log

from gsl.core.body import lump
from gsl.core.plant import nominal
from gsl.core.trajectory import Batch, Trajectory
from gsl.diagnosis.diagnose import diagnose
from gsl.diagnosis.log.log import Log, cut_log
from gsl.diagnosis.verdict.document import document
from gsl.diagnosis.verdict.localise import Cell, cells, find_regimes, sides
from gsl.errors import GslError
from gsl.robots.nao import nao

pytestmark = pytest.mark.slow


def part(count: int) -> Log:
    """Some trajectories of the arm."""
    whole = log({})
    labels = {"episodes": whole.metadata["episodes"][:count]}
    return cut_log(replace(whole, episodes=whole.episodes[:count], metadata=labels), arm())


def mapped(log: Log, z: np.ndarray) -> list[Cell]:
    return cells(log, z, find_regimes(log, nominal(arm())))


@pytest.mark.parametrize("count", [1, 2, 9])
def test_noise_names_hardly_a_cell_however_few_the_trajectories(count: int) -> None:
    log, rng = part(count), np.random.default_rng(0)
    shape = (len(log.pieces), log.pieces.real.shape[1] - log.pieces.warm_up, 2)
    named = [cell.named for _ in range(20) for cell in mapped(log, rng.standard_normal(shape))]
    assert np.mean(named) < 0.02


def test_a_joint_that_shakes_is_told_as_large_as_it_is_and_in_no_regime() -> None:
    calm = part(9)
    log = replace(calm, comparison=replace(calm.comparison, shaking=np.array([True, False])))
    scored = log.pieces.real.shape[1] - log.pieces.warm_up
    z = 2.0 * np.ones((len(log.pieces), scored, 2))
    z[:, log.comparison.count_residuals(scored)[0] :, 0] = 0.0
    found_cells = mapped(log, z)
    everywhere = {cell.joint: cell for cell in found_cells if cell.regime == "all"}
    assert [everywhere[joint].rms for joint in log.joints] == pytest.approx([2.0, 2.0])
    assert [everywhere[joint].share for joint in log.joints] == pytest.approx([0.5, 0.5])
    assert {cell.regime for cell in found_cells if cell.joint == log.joints[0] and cell.share > 0.0} == {"all"}


def test_intervals_of_one_held_out_trajectory_have_a_width() -> None:
    whole = log({"command_latency": {"delay": 0.02}})
    two = replace(whole, episodes=whole.episodes[:2], metadata={"episodes": whole.metadata["episodes"][:2]})
    result = diagnose(two, nominal(arm()), 0.002, FEW, lambda phase: None)
    cause = result.verdict.causes[0]
    assert result.selection.chosen.names == ("command_latency",)
    assert cause.low < cause.value < cause.high


def test_of_seven_pairs_of_sides_that_are_alike_hardly_any_differs() -> None:
    robot, rng = lump(nao()), np.random.default_rng(0)
    position = np.array([0.5 * robot.stance.get(joint, 0.0) for joint in robot.controlled]) + 0.1 * np.sin(
        0.1 * np.arange(151)[:, None] + np.arange(12)[:, None, None]
    )
    episodes = [Trajectory(0.02 * np.arange(151), path[:-1], path, np.zeros_like(path)) for path in position]
    log = cut_log(Batch(tuple(episodes), robot.controlled, 0.02, {}), robot)
    shape = (len(log.pieces), log.pieces.scored, len(log.joints))
    apart = [[pair for pair in sides(log, rng.standard_normal(shape)) if pair["p"] < 0.05] for _ in range(40)]
    assert len(sides(log, np.ones(shape))) == 7 and np.mean([bool(pairs) for pairs in apart]) < 0.15
    worse = np.ones(shape)
    worse[..., log.joints.index("LKneePitch")] = 3.0
    assert [pair["pair"] for pair in sides(log, worse) if pair["p"] < 0.05] == ["KneePitch"]


def test_a_joint_that_is_stuck_is_told_first() -> None:
    whole = log({})
    still = tuple(replace(episode, position=episode.position * [1.0, 0.0]) for episode in whole.episodes)
    result = diagnose(replace(whole, episodes=still), nominal(arm()), 0.002, FEW, lambda phase: None)
    (said,) = [caveat for caveat in document(result)["caveats"] if "do not" in caveat]
    assert "elbow" in said and "shoulder" not in said


def test_a_log_without_a_whole_window_is_refused() -> None:
    whole = log({})
    short = tuple(
        replace(
            episode,
            time=episode.time[:30],
            action=episode.action[:29],
            position=episode.position[:30],
            velocity=episode.velocity[:30],
        )
        for episode in whole.episodes
    )
    with pytest.raises(GslError, match="no trajectory lasts 1 s"):
        cut_log(Batch(short, whole.joints, whole.control_period, whole.metadata), arm())


def test_an_effect_that_does_not_exist_cannot_be_left_out() -> None:
    with pytest.raises(GslError, match="did you mean backlash"):
        found({}, without=("backlsh",))
